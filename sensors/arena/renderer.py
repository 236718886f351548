"""Draws textured parallelograms (see `rasteriser`) as a pinhole camera sees them: depth, and colour of an exposure."""

from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.se3 import inverse
from sensors.arena.array_types import Float32, Identity, Light
from sensors.arena.atlas import Atlas
from sensors.arena.rasteriser import Surfaces, project_surfaces, rasterise
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


class Renderer:
    """Draws one scene; `infrared` is what its n surfaces send back of near infrared light."""

    def __init__(self, surfaces: Surfaces, atlas: Atlas) -> None:
        self.infrared = surfaces.infrared
        self._surfaces = surfaces
        self._atlas = atlas
        normal = np.cross(surfaces.u, surfaces.v)
        area = np.linalg.norm(normal, axis=1)
        self._normal = normal / area[:, None]
        size = atlas.level_size[surfaces.patch, 0].astype(float)
        self._texels_per_m2 = size[:, 0] * size[:, 1] / area

    def depth(self, T_camera_world: Array, K: Array, shape: tuple[int, int]) -> DepthView:
        """Return what a camera with the intrinsics `K` (fx, fy, cx, cy) and images of `shape` (H, W) sees."""
        inverse_depth, identity = np.empty(shape, np.float32), np.empty(shape, np.int16)
        coefficients = np.zeros((len(self._normal), 12))
        project_surfaces(self._surfaces, T_camera_world, K, coefficients)
        rasterise(self._surfaces, coefficients, T_camera_world, K, inverse_depth, identity)
        return DepthView(inverse_depth, identity, self._distance(T_camera_world).astype(np.float32))

    def _distance(self, T_camera_world: Array) -> Array:
        eye = inverse(T_camera_world)[:3, 3]
        return np.asarray(np.abs(np.einsum("ni,ni->n", self._normal, self._surfaces.origin - eye)))

    def color(self, T_camera_world: Array, K: Array, shape: tuple[int, int]) -> tuple[Light, Float32]:
        """Return the light of an exposure during which the camera took the 4 poses given.

        And inverse depth (1/m) at the third of them, the middle of the exposure.
        """
        s, atlas = self._surfaces, self._atlas
        samples = len(JITTER)
        identity = np.empty((samples, *shape), np.int16)
        inverse_depth = np.empty(shape, np.float32)
        coefficients = np.zeros((samples, len(s.origin), 12))
        sharpness = np.empty((samples, len(s.origin)))
        for k in np.roll(np.arange(samples), samples // 2 - 1):
            T = T_camera_world[k]
            K_k = K - np.array([0.0, 0.0, *JITTER[k]])
            project_surfaces(s, T, K_k, coefficients[k])
            rasterise(s, coefficients[k], T, K_k, inverse_depth, identity[k])
            # A pixel covers z^2 / (f^2 cos) m^2, cos = distance / z at the image centre; four samples share it.
            sharpness[k] = self._texels_per_m2 / (K[0] * K[1] * np.maximum(self._distance(T), 0.01)) / 2.0
        light = np.empty(shape, np.uint64)
        shade(identity, coefficients, s.patch, atlas, sharpness, light)
        return light, inverse_depth
