"""Corners of one frame looked for in an earlier one: whether what they lie on stood still in between.

A corner moves when it is seen elsewhere than the camera's motion says, or when the earlier frame looks through the
place where it is now. A body that slides along its own plane escapes the second test, one without texture the first.
"""

from dataclasses import dataclass

import numpy as np

from odom.frontend.camera.lens import Lens
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.images import FrameImages
from odom.frontend.features.measurement import Measurements, measure, points_of
from odom.frontend.features.patches import cut_patches
from odom.frontend.features.view import View
from odom.frontend.matching.landmark_search import Candidates, LandmarkPatches, find_landmarks
from odom.frontend.matching.optical_flow import follow_there_and_back
from odom.frontend.matching.tuning import TUNING
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class CornerPatches(LandmarkPatches):
    """Corners of one frame, to be looked for in others: `position` (n x 3, m) is in that frame's camera.

    `covariance` (n x 3 x 3, m^2) is that of the positions.
    """

    covariance: Array
    images: FrameImages

    @classmethod
    def of(cls, view: View, uv: Array, measured: Measurements) -> "CornerPatches":
        """Return the patches around corners at `uv` (n x 2 px) of a view, which measured them with depth."""
        points, covariances = points_of(measured)
        return cls(
            points,
            np.zeros(len(uv), dtype=np.int64),
            uv,
            np.column_stack([measured.values[:, 2], measured.slope]),
            cut_patches(view.images.full, uv),
            cut_patches(view.images.half, uv / 2.0),
            covariances,
            view.images,
        )


@dataclass(frozen=True, eq=False)
class EarlierView:
    """A `view` taken in motion with `twist` (6, SI); `T_view_corners` leads to it from the later view of the corners.

    Both are the camera's poses at the middle rows' times.
    """

    view: View
    T_view_corners: Array
    twist: Array


@dataclass(frozen=True, eq=False)
class Sighting:
    """What an earlier view says of n corners: that they could be seen there, that they stood, that they moved."""

    visible: Mask
    stands: Mask
    moves: Mask


@dataclass(frozen=True, eq=False)
class _Expected:
    """Where an earlier view's middle row should show corners that stand: `rows` of them (n) inside its image.

    At `uv` (n x 2 px), with `values` (n x 3: x/z, y/z, 1/z); `variance` (n) is that of 1/z.
    """

    rows: Index
    uv: Array
    values: Array
    variance: Array

    @classmethod
    def of(cls, positions: Array, covariances: Array, earlier: EarlierView, lens: Lens) -> "_Expected":
        T = earlier.T_view_corners
        uvz = lens.project(positions, T, TUNING.search_margin_px)
        rows = np.flatnonzero(np.isfinite(uvz[:, 0]))
        points = se3.apply(T, positions[rows])
        values = np.column_stack([points[:, :2], np.ones(len(rows))]) / points[:, 2:]
        J = values[:, 2:] ** 2 * T[2, :3]
        return cls(rows, uvz[rows, :2], values, np.einsum("ni,nij,nj->n", J, covariances[rows], J))


def look_back(corners: CornerPatches, earlier: EarlierView, sensor: SensorModel) -> Sighting:
    """Return what an earlier view says of `corners` (n)."""
    n = len(corners.position)
    expected = _Expected.of(corners.position, corners.covariance, earlier, sensor.lens)
    visible, stands, moves = (np.zeros(n, dtype=np.bool_) for _ in range(3))
    nearer, gate = _nearer(expected, earlier, sensor)
    visible[expected.rows], moves[expected.rows] = ~(nearer > gate), nearer < -gate
    rows, uv, covariance_uv = _found(corners, expected, visible, earlier, sensor)
    values = expected.values[np.searchsorted(expected.rows, rows)]
    seen = measure(earlier.view, sensor, uv, covariance_uv, earlier.twist, values[:, 2])
    is_there = _chi2(seen, values[:, :2]) < TUNING.look_back_sigmas**2
    stands[rows] = is_there & ~moves[rows]
    moves[rows] |= ~is_there
    return Sighting(visible, stands, moves)


def appeared(positions: Array, covariances: Array, earlier: EarlierView, sensor: SensorModel) -> tuple[Mask, Mask]:
    """Return which of n points an earlier view could have seen (n), and which it looked through (n).

    `positions` (n x 3, m) with `covariances` (n x 3 x 3, m^2) are in the later view's camera frame. What was looked
    through was not there then.
    """
    visible, is_new = (np.zeros(len(positions), dtype=np.bool_) for _ in range(2))
    expected = _Expected.of(positions, covariances, earlier, sensor.lens)
    nearer, gate = _nearer(expected, earlier, sensor)
    visible[expected.rows], is_new[expected.rows] = np.abs(nearer) <= gate, nearer < -gate
    return visible | is_new, is_new


def _nearer(expected: _Expected, earlier: EarlierView, sensor: SensorModel) -> tuple[Array, Array]:
    """Return how much nearer than the corners the depth there is (n, 1/m; NaN: none), and how much may be chance (n).

    A rolling shutter saw the corners elsewhere than its middle row would have.
    """
    nothing, w = np.zeros((len(expected.rows), 3)), expected.values[:, 2]
    view, twist = earlier.view, earlier.twist
    sheared = measure(view, sensor, expected.uv, nothing, twist, w).values[:, :2] - expected.values[:, :2]
    there = measure(view, sensor, expected.uv - sheared * sensor.lens.intrinsics[:2], nothing, twist, w)
    sigma = np.sqrt(expected.variance + there.covariance[:, 3])
    return there.values[:, 2] - w, TUNING.look_back_depth_sigmas * sigma + TUNING.look_back_depth_share * w


def _found(
    corners: CornerPatches, expected: _Expected, visible: Mask, earlier: EarlierView, sensor: SensorModel
) -> tuple[Index, Array, Array]:
    """Find the `visible` corners: rows (m) and uv (m x 2 px) with covariance (m x 3: uu, uv, vv, px^2).

    They are found by their patches near where they are expected, else by optical flow there and back.
    """
    rows = np.flatnonzero(visible)
    if not len(rows):
        return rows, np.zeros((0, 2)), np.zeros((0, 3))
    T, view = earlier.T_view_corners, earlier.view
    candidates = Candidates.all_of(rows, np.zeros(1, dtype=np.int64), T[None])
    found = find_landmarks(corners, candidates, T, earlier.twist, view.images, sensor, len(rows))
    missed = np.setdiff1d(rows, found.rows, assume_unique=True)
    here, there, uv_missed = corners.images.half, view.images.half, corners.uv[missed] / 2.0
    guess = expected.uv[np.searchsorted(expected.rows, missed)] / 2.0
    within_px, scale = TUNING.look_back_return_px, view.images.scale
    uv, returned = follow_there_and_back(here, there, uv_missed, guess, within_px, scale)
    missed, uv = missed[returned], uv[returned]
    flow = np.tile([TUNING.look_back_flow_px**2, 0.0, TUNING.look_back_flow_px**2], (len(missed), 1))
    covariance = np.concatenate([found.covariance_uv * TUNING.look_back_noise**2, flow])
    rows_found = np.concatenate([found.rows, missed])
    step_px = np.linalg.norm(expected.uv[np.searchsorted(expected.rows, rows_found)] - corners.uv[rows_found], axis=1)
    covariance[:, [0, 2]] += (TUNING.look_back_px**2 + (TUNING.look_back_step * step_px) ** 2)[:, None]
    return (
        rows_found,
        np.concatenate([found.uv, 2.0 * uv]),
        covariance,
    )


def _chi2(seen: Measurements, rays_expected: Array) -> Array:
    """Return chi-squared (n) of the rays of n features against the expected ones (n x 2)."""
    x, y = (seen.values[:, :2] - rays_expected).T
    xx, xy, yy = seen.covariance[:, :3].T
    return np.asarray((yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy))
