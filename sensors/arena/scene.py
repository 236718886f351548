"""A scene under construction: painted parallelograms, boxes and prisms, put where a moving frame says."""

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sensors.arena.paint import Painter
from sensors.arena.texture import Image

Array = NDArray[np.float64]

ORDINARY = 0.6
"""Near infrared reflectance of ordinary stuff."""
GLASS = 0.0
"""Near infrared reflectance of what sends nothing back: glass, screens."""
BLACK = 0.08
"""Near infrared reflectance of black plastic."""


@dataclass(frozen=True, eq=False)
class Panel:
    """One surface `origin + s u + t v` (world frame, metres) and who paints it; `glow` > 0 shines by itself."""

    origin: Array
    u: Array
    v: Array
    painter: Painter
    two_sided: bool = False
    infrared: float = ORDINARY
    glow: float = 0.0

    @property
    def area(self) -> float:
        """Square metres."""
        return float(np.linalg.norm(np.cross(self.u, self.v)))

    def paint(self) -> Image:
        """Return the picture; it is another one each time, as the painter's random numbers go on."""
        return self.painter(float(np.linalg.norm(self.u)), float(np.linalg.norm(self.v)))


def pose(x: float, y: float, z: float = 0.0, yaw_deg: float = 0.0) -> Array:
    """Return T_world_thing of a thing standing at (x, y, z), turned about the vertical."""
    a = np.deg2rad(yaw_deg)
    return np.array([[np.cos(a), -np.sin(a), 0, x], [np.sin(a), np.cos(a), 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])


FACES = {
    "front": ((0, -1), (1, 0, 0), (0, 0, -1)),
    "back": ((0, 1), (-1, 0, 0), (0, 0, -1)),
    "left": ((-1, 0), (0, -1, 0), (0, 0, -1)),
    "right": ((1, 0), (0, 1, 0), (0, 0, -1)),
    "top": ((0, 0, 1), (1, 0, 0), (0, -1, 0)),
    "bottom": ((0, 0, -1), (1, 0, 0), (0, 1, 0)),
}
"""Of a box: where a face lies, what is right and what is down for someone looking at it from outside."""


@dataclass
class Builder:
    """Collects panels. A thing's own frame: x to its right, y to its back, z up; its front looks along -y."""

    panels: list[Panel] = field(default_factory=list)

    def panel(
        self,
        T: Array,
        center: tuple[float, float, float],
        u: tuple[float, float, float],
        v: tuple[float, float, float],
        painter: Painter,
        two_sided: bool = False,
        infrared: float = ORDINARY,
        glow: float = 0.0,
    ) -> None:
        """Add a panel with the given middle, right edge `u` and downward edge `v` in the frame of T_world_thing."""
        u_world, v_world = T[:3, :3] @ np.array(u, float), T[:3, :3] @ np.array(v, float)
        origin = T[:3, :3] @ np.array(center, float) + T[:3, 3] - (u_world + v_world) / 2
        self.panels.append(Panel(origin, u_world, v_world, painter, two_sided, infrared, glow))

    def box(
        self,
        T: Array,
        center: tuple[float, float, float],
        size: tuple[float, float, float],
        painter: Painter,
        faces: str = "front back left right top",
        infrared: float = ORDINARY,
        **special: Painter,
    ) -> None:
        """Add the named faces of a box; `special` paints single faces (`front=...`) in their own way."""
        half = np.array(size) / 2
        for name in faces.split():
            _, right, down = FACES[name]
            outward = -np.cross(right, down)
            at = np.array(center) + outward * half
            u, v = np.array(right) * size, np.array(down) * size
            self.panel(T, tuple(at), tuple(u), tuple(v), special.get(name, painter), infrared=infrared)

    def tube(
        self,
        T: Array,
        points: list[tuple[float, float, float]],
        radius: float,
        painter: Painter,
        sides: int = 5,
        infrared: float = ORDINARY,
    ) -> None:
        """Add a tube (leg, cable, pole) along a line of points."""
        line = np.array(points, float)
        for a, b in itertools.pairwise(line):
            axis = (b - a) / np.linalg.norm(b - a)
            side = np.cross(axis, (0.31, 0.17, 0.93) if abs(axis[2]) < 0.9 else (1.0, 0.2, 0.1))
            side /= np.linalg.norm(side)
            other = np.cross(axis, side)
            ring = [
                radius * (np.cos(2 * np.pi * k / sides) * side + np.sin(2 * np.pi * k / sides) * other)
                for k in range(sides + 1)
            ]
            for p, q in itertools.pairwise(ring):
                self.panel(T, tuple((a + b + p + q) / 2), tuple(q - p), tuple(a - b), painter, infrared=infrared)

    def drum(
        self,
        T: Array,
        center: tuple[float, float, float],
        radius: float,
        height: float,
        painter: Painter,
        sides: int = 10,
        top: Painter | None = None,
    ) -> None:
        """Add an upright prism (mug, bin, pot) with its foot at `center`; `top` closes it."""
        x, y, z = center
        self.tube(T, [(x, y, z), (x, y, z + height)], radius, painter, sides)
        if top is not None:
            self.disc(T, (x, y, z + height), (1, 0, 0), (0, -1, 0), radius, top)

    def disc(
        self,
        T: Array,
        center: tuple[float, float, float],
        right: tuple[float, float, float],
        down: tuple[float, float, float],
        radius: float,
        painter: Painter,
        strips: int = 7,
    ) -> None:
        """Add a disc, in strips as wide as the circle is; `right` and `down` as seen by who looks at it."""
        for k in range(strips):
            at = radius * ((2 * k + 1) / strips - 1)
            half = np.sqrt(radius**2 - at**2)
            middle = np.array(center) + at * np.array(down)
            u, v = 2 * half * np.array(right), 2 * radius / strips * np.array(down)
            self.panel(T, tuple(middle), tuple(u), tuple(v), painter)


def moved(panels: list[Panel], by: tuple[float, float, float]) -> list[Panel]:
    """Return the same panels elsewhere."""
    return [replace(panel, origin=panel.origin + np.array(by)) for panel in panels]
