"""A scene under construction: painted parallelograms, boxes and prisms, put where a moving frame says."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Array, Image
from sensors.arena.materials import Painter

ORDINARY = 0.6
"""Share of near infrared light that ordinary things send back; 0 is glass or a screen: no depth is measured there."""
Vector = Sequence[float] | Array
"""Three numbers: a point or a direction in metres."""


@dataclass(frozen=True, eq=False)
class Material:
    """Who paints a surface and how it answers light: `infrared` is its near infrared reflectance, `glow` > 0 shines."""

    painter: Painter
    infrared: float = ORDINARY
    glow: float = 0.0
    two_sided: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """One surface `origin + s u + t v` (world frame, metres) of a material."""

    origin: Array
    u: Array
    v: Array
    material: Material

    @cached_property
    def across(self) -> Array:
        """`u` x `v`: into the surface for who looks at it, as long as its area."""
        (a, b, c), (x, y, z) = self.u.tolist(), self.v.tolist()
        return np.array([b * z - c * y, c * x - a * z, a * y - b * x])

    @cached_property
    def area(self) -> float:
        """Square metres."""
        return float(np.linalg.norm(self.across))

    def paint(self) -> Image:
        """Return the picture; it is another one each time, as the painter's random numbers go on."""
        return self.material.painter(float(np.linalg.norm(self.u)), float(np.linalg.norm(self.v)))


class Lamps(NamedTuple):
    """Points that shine (k x 3, metres), in which direction (k x 3), and their power (k x 3, RGB, linear).

    A facing surface at r metres gets power / r^2.
    """

    points: Array
    normals: Array
    power: Array


def pose(x: float, y: float, z: float = 0.0, yaw_deg: float = 0.0) -> Array:
    """Return T_world_thing of a thing standing at (x, y, z), turned about the vertical."""
    a = np.deg2rad(yaw_deg)
    return np.array([[np.cos(a), -np.sin(a), 0, x], [np.sin(a), np.cos(a), 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])


FACES = {
    "front": ((1, 0, 0), (0, 0, -1)),
    "back": ((-1, 0, 0), (0, 0, -1)),
    "left": ((0, -1, 0), (0, 0, -1)),
    "right": ((0, 1, 0), (0, 0, -1)),
    "top": ((1, 0, 0), (0, -1, 0)),
    "bottom": ((1, 0, 0), (0, 1, 0)),
}
"""Of a box's face: what is right and what is down for someone who looks at it from outside."""


@dataclass
class Scene:
    """Collects panels and lamps. A thing's own frame: x to its right, y to its back, z up; its front looks along -y."""

    panels: list[Panel] = field(default_factory=list)
    lamps: list[Lamps] = field(default_factory=list)

    def panel(self, T: Array, center: Vector, right: Vector, down: Vector, paint: Material) -> None:
        """Add a panel with the given middle, right edge and downward edge in the frame of T_world_thing."""
        u, v = T[:3, :3] @ np.array(right, float), T[:3, :3] @ np.array(down, float)
        origin = T[:3, :3] @ np.array(center, float) + T[:3, 3] - (u + v) / 2
        self.panels.append(Panel(origin, u, v, paint))

    def box(
        self,
        T: Array,
        center: Vector,
        size: Vector,
        paint: Material,
        faces: str = "front back left right top",
        special: Mapping[str, Material] | None = None,
    ) -> None:
        """Add the named faces of a box; `special` holds the materials of single faces that differ."""
        half = np.array(size) / 2
        for name in faces.split():
            right, down = FACES[name]
            at = np.array(center) - np.cross(right, down) * half
            self.panel(T, at, np.array(right) * size, np.array(down) * size, (special or {}).get(name, paint))

    def tube(self, T: Array, points: Sequence[Vector] | Array, radius: float, paint: Material, sides: int = 5) -> None:
        """Add a tube (leg, cable, pole) along a line of points."""
        for a, b in itertools.pairwise(np.array(points, float)):
            axis = (b - a) / np.linalg.norm(b - a)
            side = np.cross(axis, (0.31, 0.17, 0.93) if abs(axis[2]) < 0.9 else (1.0, 0.2, 0.1))
            side /= np.linalg.norm(side)
            other = np.cross(axis, side)
            turns = [2 * np.pi * k / sides for k in range(sides + 1)]
            ring = [radius * (np.cos(turn) * side + np.sin(turn) * other) for turn in turns]
            for p, q in itertools.pairwise(ring):
                self.panel(T, (a + b + p + q) / 2, q - p, a - b, paint)

    def drum(
        self,
        T: Array,
        center: Vector,
        radius: float,
        height: float,
        paint: Material,
        sides: int = 10,
        top: Material | None = None,
    ) -> None:
        """Add an upright prism (mug, bin, pot) with its foot at `center`; `top` closes it."""
        x, y, z = center
        self.tube(T, [(x, y, z), (x, y, z + height)], radius, paint, sides)
        if top is not None:
            self.disc(T, (x, y, z + height), (1, 0, 0), (0, -1, 0), radius, top)

    def disc(self, T: Array, center: Vector, right: Vector, down: Vector, radius: float, paint: Material) -> None:
        """Add a disc, in strips as wide as the circle is; `right` and `down` as seen by who looks at it."""
        strips = 7
        for k in range(strips):
            at = radius * ((2 * k + 1) / strips - 1)
            half = np.sqrt(radius**2 - at**2)
            middle = np.array(center) + at * np.array(down)
            self.panel(T, middle, 2 * half * np.array(right), 2 * radius / strips * np.array(down), paint)

    def light(self, T: Array, points: Sequence[Vector], towards: Vector, power: Vector) -> None:
        """Add points that shine `towards` a direction with `power` (RGB, linear) each."""
        normal = T[:3, :3] @ np.array(towards, float)
        count = len(points)
        world = np.array(points, float) @ T[:3, :3].T + T[:3, 3]
        self.lamps.append(Lamps(world, np.tile(normal, (count, 1)), np.tile(np.array(power, float), (count, 1))))


def moved(panels: list[Panel], by: tuple[float, float, float]) -> list[Panel]:
    """Return the same panels elsewhere."""
    return [replace(panel, origin=panel.origin + np.array(by)) for panel in panels]
