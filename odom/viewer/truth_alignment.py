"""Aligns truth with the estimate while both still grow, as the evaluation does at the end.

The marker body is not the camera, and its clock is not the camera's: as soon as the motion determines them, clock
offset and hand-eye transform are estimated too (`odom.evaluation`).
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from odom.errors import InputError
from odom.evaluation import Trajectory, align
from odom.evaluation.metrics import rmse
from odom.evaluation.mocap_calibration import calibrate
from odom.evaluation.trajectory import inverse_all
from odom.frame import Stamp
from odom.geometry import se3
from odom.geometry.arrays import Array

MAX_GAP_S = 0.1
"""Truth is interpolated over at most this gap, as in the evaluation."""
_MAX_THINNED_GAP_S = 1.0
"""The same of a trajectory of hours, which has been thinned."""
_MIN_POSES = 10
"""Poses that an alignment needs; it has six unknowns."""
_MIN_SPREAD_M = 0.03
"""The walk must spread so far (RMS, along its second direction) to fix all axes: less, and noise turns the truth."""
_MAX_PENDING = 2000
"""Poses, and true poses, that wait for the other to come: a minute of frames, eight seconds of motion capture."""
_CALIBRATE_FROM_S, _CALIBRATE_GROWTH, _CALIBRATE_POSES = 8.0, 1.25, 1000
"""When clock offset and hand-eye are looked for: first after this time, which has turns enough, then whenever the
estimate has grown by this factor (searching is slow), on at most so many of its poses."""


@dataclass(frozen=True, eq=False)
class Calibrated:
    """The marker body's camera (`T_body_camera`), and the clock offset that is added to a camera stamp (seconds)."""

    T_body_camera: Array
    offset_s: float


@dataclass(frozen=True, eq=False)
class TruthInMap:
    """The transform of truth into the map, and how far off the estimate then is.

    The true camera pose in the map at t is `T_map_truth @ T_truth_body(t + offset) @ T_body_camera`, the last two as
    `calibrated` says, where that is known.
    """

    T_map_truth: Array
    calibrated: Calibrated | None
    matched: int
    ate_m: float


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


def camera_truth(truth: Trajectory, calibrated: Calibrated | None) -> Trajectory:
    """Return the truth of the camera on the camera's clock, in the world of the truth."""
    if calibrated is None:
        return truth
    return truth.of_body(calibrated.T_body_camera).delayed(-calibrated.offset_s)


def in_map(truth: Trajectory, fit: TruthInMap) -> Trajectory:
    """Return the camera's true trajectory in the map, on the camera's clock."""
    return camera_truth(truth, fit.calibrated).moved(fit.T_map_truth)


def align_truth(estimate: Trajectory, truth: Trajectory, calibrated: Calibrated | None) -> TruthInMap | None:
    """Return truth aligned with the estimate (map frame), None while the motion does not determine it."""
    if len(estimate) < _MIN_POSES or len(truth) < _MIN_POSES:
        return None
    T_truth, valid = camera_truth(truth, calibrated).at(estimate.stamps, _gap_s(truth))
    if valid.sum() < _MIN_POSES:
        return None
    points_truth, points = T_truth[valid, :3, 3], estimate.positions[valid]
    alignment = align(points_truth, points)
    if alignment.spread_m[1] < _MIN_SPREAD_M:
        return None
    errors = np.linalg.norm(se3.apply(alignment.T_truth_estimate, points_truth) - points, axis=1)
    return TruthInMap(alignment.T_truth_estimate, calibrated, int(valid.sum()), rmse(errors))


def _gap_s(truth: Trajectory) -> float:
    """Return the gap to interpolate over: that of the evaluation, or more where truth has been thinned."""
    thinned = 3e-9 * float(np.median(np.diff(truth.stamps)))
    return min(max(MAX_GAP_S, thinned), _MAX_THINNED_GAP_S)


class ProgressiveCalibration:
    """Estimates clock offset and hand-eye again whenever the estimate has grown by a quarter, from eight seconds on."""

    def __init__(self) -> None:
        self._due_s = _CALIBRATE_FROM_S
        self.found: Calibrated | None = None

    def update(self, estimate: Trajectory, truth: Trajectory) -> None:
        """Calibrate when it is due; `found` stays None while the motion does not determine it."""
        if estimate.duration_s < self._due_s:
            return
        self._due_s = _CALIBRATE_GROWTH * estimate.duration_s
        stride = max(1, -(-len(estimate) // _CALIBRATE_POSES))
        try:
            result = calibrate(estimate.take(np.arange(0, len(estimate), stride)), truth)
        except InputError:
            return
        if not result.notes:
            self.found = Calibrated(result.T_body_camera, result.offset_s)


class Comparison:
    """Compares each published pose with truth once both are there; at most 2000 of each wait for the other."""

    def __init__(self) -> None:
        self._pending: deque[tuple[Stamp, Array, float, float]] = deque(maxlen=_MAX_PENDING)
        self._truth: deque[tuple[Stamp, Array]] = deque(maxlen=_MAX_PENDING)

    def add(self, stamp: Stamp, T_map_camera: Array, bound_m: float, bound_deg: float) -> None:
        """Remember a published pose and its 3-sigma bounds."""
        self._pending.append((stamp, T_map_camera, bound_m, bound_deg))

    def add_truth(self, stamp: Stamp, T_truth_body: Array) -> None:
        """Remember a true pose; one that is not newer than the last is ignored."""
        if not self._truth or stamp > self._truth[-1][0]:
            self._truth.append((stamp, T_truth_body))

    def errors(self, fit: TruthInMap) -> Iterator[PoseError]:
        """Yield the errors of the poses that have truth on both sides by now, and forget these poses."""
        if not self._pending or not self._truth:
            return
        recent = Trajectory(
            np.array([stamp for stamp, _ in self._truth], dtype=np.int64), np.array([T for _, T in self._truth])
        )
        true = in_map(recent, fit)
        stamps = np.array([entry[0] for entry in self._pending], dtype=np.int64)
        due = stamps <= true.stamps[-1]
        T_true, valid = true.at(stamps[due], MAX_GAP_S)
        judged = [entry for entry, is_due in zip(self._pending, due, strict=True) if is_due]
        self._pending = deque(
            (e for e, is_due in zip(self._pending, due, strict=True) if not is_due), maxlen=_MAX_PENDING
        )
        if not valid.any():
            return
        T = np.array([entry[1] for entry in judged])
        E = inverse_all(T) @ np.where(valid[:, None, None], T_true, np.eye(4))
        metres = np.linalg.norm(E[:, :3, 3], axis=1)
        degrees = np.degrees(Rotation.from_matrix(E[:, :3, :3]).magnitude())
        for entry, ok, m, deg in zip(judged, valid, metres, degrees, strict=True):
            if ok:
                yield PoseError(entry[0], float(m), float(deg), entry[2], entry[3])
