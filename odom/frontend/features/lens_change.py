"""A change of lens: what was measured through the old one is converted to what the new one would have measured.

Pixels and depth images stay what they are; the ray of a pixel and what its depth means change. The rays of both lenses
are given in the same frame, so that poses mean the same before and after.
"""

from dataclasses import dataclass, replace

import numpy as np

from odom.frame.depth_model import aside_px
from odom.frontend.camera.lens import Lens, rays_at
from odom.frontend.features.measurement import Measurements
from odom.frontend.features.shutter_compensation import depth_errors
from odom.geometry.arrays import Array

_BEYOND_PX = 50.0
"""How far outside of the image a feature may be that was carried to the middle row's time."""


@dataclass(frozen=True, eq=False)
class LensChange:
    """The old lens of a camera, and the new one that replaces it; the rays of both are given in the same frame."""

    before: Lens
    after: Lens

    def values(self, values: Array, slope: Array) -> Array:
        """Return x/z, y/z and 1/z (n x 3, NaN where not measured) through the new lens.

        `slope` (n x 2) is that of inverse depth per pixel, on which a shift of depth against colour shows.
        """
        height, width = self.before.rays.shape[:2]
        ahead = np.column_stack([values[:, :2], np.ones(len(values))])
        old = self.before
        uv = old.project(ahead, np.eye(4), -_BEYOND_PX)[:, :2]
        is_seen = np.isfinite(uv[:, 0])
        uv = np.where(is_seen[:, None], uv, 0.0)
        (offset, scale), w = depth_errors(uv, width, height, old.depth_model).T, values[:, 2]
        read_px = aside_px(self.after.depth_model - old.depth_model, uv, w, width, height)
        measured = offset + scale * (w - (slope * read_px).sum(axis=1))
        offset, scale = depth_errors(uv, width, height, self.after.depth_model).T
        new = np.column_stack([rays_at(self.after.rays, uv), (measured - offset) / scale])
        return np.where(is_seen[:, None], new, values)

    def measured(self, measurements: Measurements) -> Measurements:
        """Return a frame's measurements through the new lens; derivatives by the timing and covariances stay."""
        return replace(measurements, values=self.values(measurements.values, measurements.slope))

    def points(self, points: Array, slope: Array | None = None) -> Array:
        """Return `points` (n x 3, m, camera frame), each made of a ray and a depth, through the new lens."""
        slope = np.zeros((len(points), 2)) if slope is None else slope
        new = self.values(np.column_stack([points[:, :2], np.ones(len(points))]) / points[:, 2:], slope)
        return np.asarray(np.column_stack([new[:, :2], np.ones(len(points))]) / new[:, 2:])

    def positions(self, positions: Array, slope: Array, T_camera_map: Array) -> tuple[Array, Array]:
        """Return where landmarks are as the cameras that measured them see them through the new lens.

        `positions` (n x 3, m, map frame), `slope` (n x 2) as above, and the camera of each (n x 4 x 4). The second
        value is the factor by which each inverse depth changes (n).
        """
        R, t = T_camera_map[:, :3, :3], T_camera_map[:, :3, 3]
        seen = np.einsum("nij,nj->ni", R, positions) + t
        new = self.points(seen, slope)
        return np.einsum("nji,nj->ni", R, new - t), seen[:, 2] / new[:, 2]
