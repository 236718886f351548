"""Draws a scene of textured parallelograms (see `raster`) into a pinhole camera: depth, and colour of an exposure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensors.arena.raster import project_surfaces, rasterise
from sensors.arena.shading import shade
from sensors.arena.texture import Atlas

Array = NDArray[np.float64]

JITTER = np.array([[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]])
"""Where in the pixel the samples of one exposure lie (rotated grid), pixels."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The geometry of a scene: n parallelograms in the world frame, metres (see `raster`).

    `infrared` is what a surface returns of near infrared light (0: glass or a black screen, nothing comes back).
    """

    origin: Array
    u: Array
    v: Array
    two_sided: NDArray[np.bool_]
    infrared: NDArray[np.float32]
    patch: NDArray[np.int32]


class Renderer:
    """Draws one scene; keeps its buffers between calls, so one object serves one thread."""

    def __init__(self, surfaces: Surfaces, atlas: Atlas) -> None:
        self.infrared = surfaces.infrared
        self._surfaces = surfaces
        self._atlas = atlas
        normal = np.cross(surfaces.u, surfaces.v)
        self._area = np.linalg.norm(normal, axis=1)
        self._normal = normal / self._area[:, None]
        size = atlas.level_size[surfaces.patch, 0].astype(float)
        self._texels_per_m2 = size[:, 0] * size[:, 1] / self._area

    def _project(self, T_camera_world: Array, K: Array) -> Array:
        s = self._surfaces
        out = np.zeros((len(s.origin), 12))
        project_surfaces(s.origin, s.u, s.v, s.two_sided, T_camera_world, K, out)
        return out

    def depth(
        self, T_camera_world: Array, K: Array, shape: tuple[int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.int16], Array]:
        """Return inverse depth (1/m), the number of the surface in each pixel and each surface's distance (m)."""
        s = self._surfaces
        inverse_depth = np.empty(shape, np.float32)
        identity = np.empty(shape, np.int16)
        rasterise(s.origin, s.u, s.v, self._project(T_camera_world, K), T_camera_world, K, inverse_depth, identity)
        return inverse_depth, identity, self._distance(T_camera_world)

    def _distance(self, T_camera_world: Array) -> Array:
        eye = -T_camera_world[:3, :3].T @ T_camera_world[:3, 3]
        return np.asarray(np.abs(np.einsum("ni,ni->n", self._normal, self._surfaces.origin - eye)))

    def color(
        self, T_camera_world: Array, K: Array, shape: tuple[int, int]
    ) -> tuple[NDArray[np.uint64], NDArray[np.float32]]:
        """Return the light (packed, see `shade`) of an exposure during which the camera took the 4 poses given.

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
            project_surfaces(s.origin, s.u, s.v, s.two_sided, T, K_k, coefficients[k])
            rasterise(s.origin, s.u, s.v, coefficients[k], T, K_k, inverse_depth, identity[k])
            # A pixel covers z^2 / (f^2 cos) m^2, cos = distance / z at the image centre; four samples share it.
            sharpness[k] = self._texels_per_m2 / (K[0] * K[1] * np.maximum(self._distance(T), 0.01)) / 2.0
        out = np.empty(shape, np.uint64)
        shade(identity, coefficients, s.patch, atlas.level_offset, atlas.level_size, sharpness, atlas.texels, out)
        return out, inverse_depth
