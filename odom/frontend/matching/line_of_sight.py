"""What a view shows where landmarks should be: themselves, something before or behind them, or an over-exposed area."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.frame.depth_model import as_measured
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.shutter_compensation import sigma_at
from odom.frontend.features.view import View
from odom.frontend.matching.tuning import TUNING
from odom.geometry.arrays import Array, Image, Mask
from odom.geometry.compiled import compiled

_PLACES = 9
"""Where depth is looked at around a landmark: a square of three by three."""
_WHITE = 250
"""From this grey level on the image counts as saturated; a little below 255, which JPEG does not keep."""


@dataclass(frozen=True, eq=False)
class LineOfSight:
    """Which of n landmarks are `hidden` by something nearer, and which are `seen_through`, as only farther things show.

    Where too much light has `washed_out` the image to white, nothing can be found.
    """

    hidden: Mask
    seen_through: Mask
    washed_out: Mask

    @classmethod
    def to(
        cls, points: Array, covariances: Array, T_camera_points: Array, view: View, sensor: SensorModel
    ) -> "LineOfSight":
        """Look from a view at landmarks at `points` (n x 3, m) with `covariances` (n x 3 x 3, m^2).

        Depth is looked at all around: rolling shutters, and depth that comes later than colour, show things elsewhere
        than in the middle row. So a landmark is neither near an edge of the depth, or where little is measured.
        """
        lens, depth_mm = sensor.lens, view.depth_mm
        height, width = depth_mm.shape
        uvz = lens.project(points, T_camera_points, float(TUNING.sight_step_px))
        visible = np.flatnonzero(uvz[:, 2] > 0.0)
        uvz = uvz.take(visible, 0)
        expected = 1.0 / uvz[:, 2]
        sigma = _sigma(
            expected, covariances.take(visible, 0), T_camera_points, sensor.noise.feature_noise.inverse_depth_sigma
        )
        gate = TUNING.look_back_depth_sigmas * sigma + TUNING.look_back_depth_share * expected
        uv, measured, scale = as_measured(lens.depth_model, uvz[:, :2], expected, width, height)
        hidden, seen_through, washed_out = (np.zeros(len(points), dtype=np.bool_) for _ in range(3))
        washed_out[visible] = _is_white(view.images.full, uvz[:, :2], TUNING.sight_step_px)
        hidden[visible], seen_through[visible] = _compared(depth_mm, uv, measured, gate * scale, TUNING.sight_step_px)
        return cls(hidden, seen_through, washed_out)


@compiled
def _sigma(expected: Array, covariances: Array, T: Array, noise: Array) -> Array:
    """Return one sigma (n) of the inverse depth that landmarks and the depth image together have."""
    out = np.empty(len(expected))
    for k in range(len(expected)):
        C, w = covariances[k], expected[k]
        variance = 0.0
        for i in range(3):
            for j in range(3):
                variance += T[2, i] * C[i, j] * T[2, j]
        out[k] = np.sqrt(w**4 * variance + sigma_at(noise, w) ** 2)
    return out


@compiled
def _compared(depth_mm: NDArray[np.uint16], uv: Array, expected: Array, gate: Array, step_px: int) -> tuple[Mask, Mask]:
    """Return around which of `uv` (n x 2 px) all depth is nearer than `expected` (n, 1/m) by a `gate`, or all farther.

    Depth is looked at in nine places, each `step_px` from the next, and must be measured in five of them.
    """
    height, width = depth_mm.shape
    hidden, seen_through = np.zeros(len(uv), np.bool_), np.zeros(len(uv), np.bool_)
    for k in range(len(uv)):
        column, row = round(uv[k, 0]), round(uv[k, 1])
        count, nearest, farthest = 0, 0.0, np.inf
        for i in range(row - step_px, row + step_px + 1, step_px):
            for j in range(column - step_px, column + step_px + 1, step_px):
                if 0 <= i < height and 0 <= j < width and depth_mm[i, j] > 0:
                    w = 1000.0 / depth_mm[i, j]
                    count, nearest, farthest = count + 1, max(nearest, w), min(farthest, w)
        if count > _PLACES // 2:
            hidden[k] = farthest > expected[k] + gate[k]
            seen_through[k] = nearest < expected[k] - gate[k]
    return hidden, seen_through


@compiled
def _is_white(grey: Image, uv: Array, step_px: int) -> Mask:
    """Return around which of `uv` (n x 2 px) an image is white in all nine places."""
    height, width = grey.shape
    out = np.ones(len(uv), np.bool_)
    for k in range(len(uv)):
        column, row = round(uv[k, 0]), round(uv[k, 1])
        for i in range(row - step_px, row + step_px + 1, step_px):
            for j in range(column - step_px, column + step_px + 1, step_px):
                if 0 <= i < height and 0 <= j < width and grey[i, j] < _WHITE:
                    out[k] = False
    return out
