"""Draws textured parallelograms (see `rasteriser`) as a pinhole camera sees them: depth, and colour of an exposure."""

from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Array, Mask
from odom.geometry.se3 import inverse
from sensors.arena.array_types import Float32, Identity, Light
from sensors.arena.atlas import Atlas
from sensors.arena.people import People, Placed
from sensors.arena.rasteriser import NEAR_M, Surfaces, project_surfaces, rasterise
from sensors.arena.shading import shade

JITTER = np.array([[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]])
"""Where in the pixel the four samples of one exposure lie, pixels: a rotated grid, as graphics hardware takes it."""


class DepthView(NamedTuple):
    """What an infrared camera sees: H x W inverse depth (1/m), H x W numbers of surfaces, their n distances (m).

    The distance is that from the camera to the surface's plane.
    """

    inverse_depth: Float32
    identity: Identity
    distance: Float32


class Moments(NamedTuple):
    """When a colour image is exposed: at `t` (seconds of the walk, one for each sample), the middle row.

    The rows above it earlier, those below later, `readout_s` over `rows` rows; 0 for all at once.
    """

    t: Array
    readout_s: float = 0.0
    rows: int = 1


class Renderer:
    """Draws one scene; `infrared` is what its n surfaces send back of near infrared light.

    Its last surfaces are those of `people`, if there are any: they are elsewhere at each time (seconds of the walk).
    """

    def __init__(self, surfaces: Surfaces, atlas: Atlas, people: People | None = None) -> None:
        self.infrared = surfaces.infrared
        self._surfaces = surfaces
        self._atlas = atlas
        self._people = people
        self._normal, area = _normals(surfaces.u, surfaces.v)
        size = atlas.level_size[surfaces.patch, 0].astype(float)
        self._texels_per_m2 = size[:, 0] * size[:, 1] / area

    def near(self, T_world_camera: Array) -> "Renderer":
        """Return what draws the surroundings of a camera: this, which draws all that there is."""
        return self

    def depth(self, T_camera_world: Array, K: Array, shape: tuple[int, int], t: float) -> DepthView:
        """Return what a camera with the intrinsics `K` (fx, fy, cx, cy) and images of `shape` (H, W) sees at `t`."""
        surfaces, normal = self._surfaces, self._normal
        if self._people is not None:
            surfaces, normal = self._with(self._people.at(t))
        inverse_depth, identity = np.empty(shape, np.float32), np.empty(shape, np.int16)
        coefficients = np.zeros((len(normal), 12))
        project_surfaces(surfaces, T_camera_world, K, coefficients)
        rasterise(surfaces, coefficients, T_camera_world, K, inverse_depth, identity)
        distance = _distance(surfaces, normal, T_camera_world)
        return DepthView(inverse_depth, identity, distance.astype(np.float32))

    def color(self, T_camera_world: Array, K: Array, shape: tuple[int, int], moments: Moments) -> tuple[Light, Float32]:
        """Return the light of an exposure during which the camera took the 4 poses given.

        And inverse depth (1/m) at the third of them, the middle of the exposure.
        """
        samples = len(JITTER)
        identity = np.empty((samples, *shape), np.int16)
        inverse_depth = np.empty(shape, np.float32)
        coefficients = np.zeros((samples, len(self._normal), 12))
        sharpness = np.empty((samples, len(self._normal)))
        for k in np.roll(np.arange(samples), samples // 2 - 1):
            T = T_camera_world[k]
            K_k = K - np.array([0.0, 0.0, *JITTER[k]])
            surfaces, normal = self._rolled(T, K_k, shape, moments, float(moments.t[k]))
            project_surfaces(surfaces, T, K_k, coefficients[k])
            rasterise(surfaces, coefficients[k], T, K_k, inverse_depth, identity[k])
            # A pixel covers z^2 / (f^2 cos) m^2, cos = distance / z at the image centre; four samples share it.
            distance = _distance(surfaces, normal, T)
            sharpness[k] = self._texels_per_m2 / (K[0] * K[1] * np.maximum(distance, 0.01)) / 2.0
        light = np.empty(shape, np.uint64)
        shade(identity, coefficients, self._surfaces.patch, self._atlas, sharpness, light)
        return light, inverse_depth

    def moving(self, T_camera_world: Array, K: Array, shape: tuple[int, int], moments: Moments) -> tuple[Mask, Float32]:
        """Return which pixels show what moves (see `People.moving`) at the first of the moments, and inverse depth."""
        t = float(moments.t[0])
        surfaces, _ = self._rolled(T_camera_world, K, shape, moments, t)
        inverse_depth, identity = np.empty(shape, np.float32), np.empty(shape, np.int16)
        coefficients = np.zeros((len(self._normal), 12))
        project_surfaces(surfaces, T_camera_world, K, coefficients)
        rasterise(surfaces, coefficients, T_camera_world, K, inverse_depth, identity)
        moves = np.zeros(len(self._normal) + 1, bool)
        if self._people is not None:
            theirs = self._people.moving(t)
            moves[-1 - len(theirs) : -1] = theirs
        return moves[identity], inverse_depth

    def _rolled(
        self, T_camera_world: Array, K: Array, shape: tuple[int, int], moments: Moments, t: float
    ) -> tuple[Surfaces, Array]:
        """Return surfaces and normals, each corner of the people's where it is when its row is exposed."""
        if self._people is None:
            return self._surfaces, self._normal
        if not moments.readout_s:
            return self._with(self._people.at(t))
        half = 0.5 * moments.readout_s
        first, last = self._people.at(t - half), self._people.at(t + half)

        def in_its_row(a: Array, b: Array) -> Array:
            x = (0.5 * (a + b)) @ T_camera_world[:3, :3].T + T_camera_world[:3, 3]
            row = K[1] * x[:, 1] / np.maximum(x[:, 2], NEAR_M) + K[3]
            share = np.where(x[:, 2] > NEAR_M, np.clip((row - 0.5 * shape[0]) / moments.rows, -0.6, 0.6), 0.0)
            return np.asarray(a + (0.5 + share[:, None]) * (b - a))

        origin = in_its_row(first.origin, last.origin)
        right = in_its_row(first.origin + first.u, last.origin + last.u)
        below = in_its_row(first.origin + first.v, last.origin + last.v)
        return self._with(Placed(origin, right - origin, below - origin))

    def _with(self, placed: Placed) -> tuple[Surfaces, Array]:
        """Return surfaces and normals with the people's where they are."""
        s, still = self._surfaces, len(self._normal) - len(placed.origin)
        origin, u, v = (np.concatenate([all_[:still], new]) for all_, new in zip(s[:3], placed, strict=True))
        normal = np.concatenate([self._normal[:still], _normals(placed.u, placed.v)[0]])
        return s._replace(origin=origin, u=u, v=v), normal


def _normals(u: Array, v: Array) -> tuple[Array, Array]:
    """Return the unit normals (n x 3) and areas (n, square metres) of surfaces with the edges `u` and `v`."""
    normal = np.cross(u, v)
    area = np.linalg.norm(normal, axis=1)
    return normal / area[:, None], area


def _distance(surfaces: Surfaces, normal: Array, T_camera_world: Array) -> Array:
    eye = inverse(T_camera_world)[:3, 3]
    return np.asarray(np.abs(np.einsum("ni,ni->n", normal, surfaces.origin - eye)))
