"""Truth brought into the estimate's map while both still grow, as the evaluation does it at the end.

The marker body is not the camera and its clock is not the camera's: as soon as the motion tells them, the clock offset
and the hand-eye transform are estimated too (`odom.evaluation`).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from odom.errors import InputError
from odom.evaluation import Trajectory, align
from odom.evaluation.metrics import rmse
from odom.evaluation.trajectory import inverse_all
from odom.frame import Stamp
from odom.registration import se3
from odom.viewer.trail import Trail

Array = NDArray[np.float64]

MAX_GAP_S = 0.1
_MIN_POSES = 10
_MIN_SPREAD_M = 0.03
_MAX_PENDING = 2000


@dataclass(frozen=True, eq=False)
class TruthInMap:
    """How truth is brought into the map, and how far off the estimate is after that.

    A true camera pose in the map is `T_map_truth @ T_truth_body(t - time_offset_s) @ T_body_camera`.
    """

    T_map_truth: Array
    T_body_camera: Array
    time_offset_s: float
    matched: int
    ate_m: float
    calibrated: bool


@dataclass(frozen=True)
class PoseError:
    """How far one pose is from truth, and the 3-sigma bounds that its covariance promises (NaN when not known)."""

    stamp: Stamp
    position_m: float
    rotation_deg: float
    bound_m: float
    bound_deg: float


def three_sigma(covariance: Array) -> tuple[float, float]:
    """Return the 3-sigma bounds (metres, degrees) along the worst direction of a 6 x 6 covariance."""
    worst = [
        float(np.sqrt(max(np.linalg.eigvalsh(block)[-1], 0.0))) for block in (covariance[:3, :3], covariance[3:, 3:])
    ]
    return 3.0 * worst[0], 3.0 * float(np.degrees(worst[1]))


def align_truth(estimate: Trajectory, truth: Trajectory) -> TruthInMap | None:
    """Return truth aligned with the estimate (map frame), None while the motion does not determine it."""
    if len(estimate) < _MIN_POSES or len(truth) < _MIN_POSES:
        return None
    T_truth, valid = truth.at(estimate.stamps, MAX_GAP_S)
    if valid.sum() < _MIN_POSES:
        return None
    points_truth, points = T_truth[valid, :3, 3], estimate.positions[valid]
    try:
        alignment = align(points_truth, points)
    except InputError:
        return None
    if alignment.spread_m[1] < _MIN_SPREAD_M:
        return None
    errors = np.linalg.norm(se3.apply(alignment.T_truth_estimate, points_truth) - points, axis=1)
    return TruthInMap(alignment.T_truth_estimate, np.eye(4), 0.0, int(valid.sum()), rmse(errors), False)


def in_map(truth: Trajectory, fit: TruthInMap) -> Trajectory:
    """Return the camera's true trajectory in the map, on the camera's clock."""
    return truth.moved(fit.T_map_truth).of_body(fit.T_body_camera).delayed(fit.time_offset_s)


class Comparison:
    """Pairs each published pose with truth once both are there; at most 2000 poses wait for theirs."""

    def __init__(self) -> None:
        self._pending: list[tuple[Stamp, Array, float, float]] = []

    def add(self, stamp: Stamp, T_map_camera: Array, bound_m: float, bound_deg: float) -> None:
        """Remember a published pose."""
        self._pending.append((stamp, T_map_camera, bound_m, bound_deg))
        if len(self._pending) > _MAX_PENDING:
            del self._pending[: _MAX_PENDING // 2]

    def errors(self, truth: Trail, fit: TruthInMap) -> Iterator[PoseError]:
        """Yield the errors of the poses that truth has caught up with, and forget those."""
        if not self._pending:
            return
        earliest = self._pending[0][0] - round((MAX_GAP_S + abs(fit.time_offset_s)) * 1e9)
        true = in_map(truth.trajectory(Stamp(earliest)), fit)
        if not len(true):
            return
        stamps = np.array([entry[0] for entry in self._pending], dtype=np.int64)
        due = stamps <= true.stamps[-1]
        T_true, valid = true.at(stamps[due], MAX_GAP_S)
        judged = [entry for entry, is_due in zip(self._pending, due, strict=True) if is_due]
        self._pending = [entry for entry, is_due in zip(self._pending, due, strict=True) if not is_due]
        if not valid.any():
            return
        T = np.array([entry[1] for entry in judged])
        E = inverse_all(T) @ np.where(valid[:, None, None], T_true, np.eye(4))
        metres = np.linalg.norm(E[:, :3, 3], axis=1)
        degrees = np.degrees(Rotation.from_matrix(E[:, :3, :3]).magnitude())
        for entry, ok, m, deg in zip(judged, valid, metres, degrees, strict=True):
            if ok:
                yield PoseError(entry[0], float(m), float(deg), entry[2], entry[3])
