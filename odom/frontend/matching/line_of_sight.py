"""What the depth image shows where landmarks should be: themselves, something before them, or what is behind them."""

from dataclasses import dataclass

import numpy as np

from odom.frame.depth_model import as_measured
from odom.frontend.camera.lens import project
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.view import View
from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Array, Mask

_AROUND = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)
"""Where depth is looked at (9 x 2), in steps of `sight_step_px`."""


@dataclass(frozen=True, eq=False)
class LineOfSight:
    """Which of n landmarks are `hidden` by something nearer, and which places of theirs are `seen_through`."""

    hidden: Mask
    seen_through: Mask

    @classmethod
    def to(
        cls, points: Array, covariances: Array, T_camera_points: Array, view: View, sensor: SensorModel
    ) -> "LineOfSight":
        """Look from a view at landmarks at `points` (n x 3, m) with `covariances` (n x 3 x 3, m^2).

        Depth is looked at all around: rolling shutters, and depth that comes later than colour, show things elsewhere
        than in the middle row. So neither is said of a landmark near an edge of the depth, or where little is measured.
        """
        T, lens, noise = T_camera_points, sensor.lens, sensor.noise.noise.inverse_depth_sigma
        height, width = view.depth_mm.shape
        step_px = TUNING.sight_step_px
        uvz = project(points, T, lens.intrinsics, lens.distortion, width, height, step_px)
        visible = np.flatnonzero(np.isfinite(uvz[:, 0]))
        expected = 1.0 / uvz[visible, 2]
        across = expected[:, None] ** 2 * T[2, :3]
        variance = np.einsum("ni,nij,nj->n", across, covariances[visible], across)
        sigma = np.sqrt(variance + np.interp(expected, noise[0], noise[1]) ** 2)
        gate = TUNING.look_back_depth_sigmas * sigma + TUNING.look_back_depth_share * expected
        uv, expected, scale = as_measured(lens.depth_model, uvz[visible, :2], expected, width, height)
        gate = gate * scale
        u, v = (uv[:, None].round().astype(int) + step_px * _AROUND).transpose(2, 0, 1)
        is_inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        depth_mm = view.depth_mm[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)].astype(np.float64)
        is_measured = is_inside & (depth_mm > 0.0)
        inverse_depth = 1000.0 / np.where(is_measured, depth_mm, 1.0)
        nearest = np.where(is_measured, inverse_depth, -np.inf).max(axis=1)
        farthest = np.where(is_measured, inverse_depth, np.inf).min(axis=1)
        is_known = np.count_nonzero(is_measured, axis=1) > len(_AROUND) // 2
        hidden, seen_through = (np.zeros(len(points), dtype=np.bool_) for _ in range(2))
        hidden[visible] = is_known & (farthest > expected + gate)
        seen_through[visible] = is_known & (nearest < expected - gate)
        return cls(hidden, seen_through)
