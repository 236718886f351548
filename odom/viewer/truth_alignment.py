"""Aligns truth with the estimate while both still grow, by positions and orientations.

The marker body is not the camera, and its clock is not the camera's: as soon as the motion determines them, clock
offset and hand-eye transform are estimated too (`odom.evaluation`).
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from odom.errors import InputError
from odom.evaluation import Trajectory, align
from odom.evaluation.metrics import rmse
from odom.evaluation.mocap_calibration import Calibration, calibrate
from odom.evaluation.pose_alignment import PoseAlignment, PoseErrors, align_poses, align_poses_alike
from odom.evaluation.truth_noise import truth_noise
from odom.frame import Stamp
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.geometry.rotations import angles_of
from odom.viewer.claimed_covariances import ClaimedCovariances

MAX_GAP_S = 0.1
"""Truth is interpolated over at most this gap, as in the evaluation."""
_MAX_THINNED_GAP_S = 1.0
"""The same for a trajectory of hours, which has been thinned out."""
_MIN_POSES = 10
"""Poses that an alignment needs; it has six unknowns."""
_SURE_RAD = np.radians(3.0)
"""Truth is shown once the standard deviation of the alignment's rotation is below this: with more it is visibly askew,
with less a short walk with motion capture waits for long."""
_MARKERS_ALONE = np.diag(np.square([0.01, 0.01, 0.01, np.inf, np.inf, np.inf]))
"""Before the marker body is calibrated its orientation says nothing, and its position (1 cm) only ..."""
_LEVER = np.diag(np.square([0.1, 0.1, 0.1, 0.0, 0.0, 0.0]))
"""... as far as the camera is from the markers: a hand's breadth (m)."""
_MAX_PENDING = 2000
"""Poses, and true poses, that wait for the other to come: a minute of frames, eight seconds of motion capture."""
_CALIBRATE_FROM_S, _CALIBRATE_GROWTH, _CALIBRATE_POSES = 8.0, 1.25, 1000
"""When clock offset and hand-eye are looked for: first after this time, which has turns enough, then whenever the
estimate has grown by this factor (searching is slow), on at most so many of its poses."""


@dataclass(frozen=True, eq=False)
class TruthInMap:
    """Where truth lies in the map, and how far the estimate is from it.

    The true camera pose in the map at t is `T_map_truth @ T_truth_body(t + offset) @ T_body_camera`, the last two as
    `calibrated` says, where that is known. `truth_covariance` (6 x 6) is that of a true camera pose. `ate_m` is as the
    evaluation computes it: after the alignment of the positions alone.
    """

    alignment: PoseAlignment
    truth_covariance: Array
    calibrated: Calibration | None
    matched: int
    ate_m: float

    @property
    def T_map_truth(self) -> Array:
        """The pose of the truth's world in the map."""
        return se3.inverse(self.alignment.T_truth_estimate)

    def bounds(self, T_map_camera: Array, covariance: Array | None) -> tuple[float, float]:
        """Return the 3-sigma bounds (m, deg) of the error against truth of a pose with this covariance (6 x 6).

        Truth and alignment are not certain either: they widen the bounds. NaN where there is no covariance.
        """
        if covariance is None:
            return np.nan, np.nan
        return three_sigma(covariance + self.truth_covariance + self.alignment.at(T_map_camera))


@dataclass(frozen=True)
class PoseError:
    """How far one pose is from truth, and the 3-sigma bounds that are promised (NaN when not known)."""

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


def in_map(truth: Trajectory, fit: TruthInMap) -> Trajectory:
    """Return the camera's true trajectory in the map, on the camera's clock."""
    of_camera = truth if fit.calibrated is None else fit.calibrated.camera_truth(truth)
    return of_camera.moved(fit.T_map_truth)


def align_truth(
    estimate: Trajectory, claimed: ClaimedCovariances, truth: Trajectory, calibrated: Calibration | None, markers: bool
) -> TruthInMap | None:
    """Return truth aligned with the estimate (map frame), None while too little is known.

    `markers` says that truth is of a marker body, not of the camera itself.
    """
    if len(estimate) < _MIN_POSES or len(truth) < _MIN_POSES:
        return None
    of_camera = truth if calibrated is None else calibrated.camera_truth(truth)
    T_truth, valid = of_camera.at(estimate.stamps, _gap_s(truth))
    if valid.sum() < _MIN_POSES:
        return None
    matched, T_truth = estimate.take(valid), T_truth[valid]
    T, noise = matched.T_world_body, truth_noise(truth)
    own = np.zeros((6, 6)) if noise is None else noise.interpolated_covariance
    hand_eye = _LEVER if markers else np.zeros((6, 6))
    if calibrated is not None:
        hand_eye = np.diag(np.square(calibrated.hand_eye_sigma))
    try:
        if markers and calibrated is None:
            alignment = align_poses(T, T_truth, PoseErrors(np.tile(_MARKERS_ALONE, (len(T), 1, 1)), hand_eye=hand_eye))
        else:
            alignment = _by_covariances(T, T_truth, *claimed.of(matched.stamps), own, hand_eye)
    except InputError:
        return None
    if alignment.sigma_rad > _SURE_RAD:
        return None
    by_positions = align(matched.positions, T_truth[:, :3, 3]).T_truth_estimate
    off = np.linalg.norm(se3.apply(by_positions, matched.positions) - T_truth[:, :3, 3], axis=1)
    return TruthInMap(alignment, own + hand_eye, calibrated, len(T), rmse(off))


def _by_covariances(
    T: Array, T_truth: Array, claimed: Array, is_known: Mask, own: Array, hand_eye: Array
) -> PoseAlignment:
    """Return the alignment of the poses whose covariance is known; of all, where hardly any is."""
    if is_known.sum() < _MIN_POSES:
        return align_poses_alike(T, T_truth, hand_eye)
    independent = np.tile(own, (int(is_known.sum()), 1, 1))
    return align_poses(T[is_known], T_truth[is_known], PoseErrors(independent, claimed[is_known], hand_eye))


def _gap_s(truth: Trajectory) -> float:
    """Return the longest gap to interpolate over: that of the evaluation, or more where truth has been thinned out."""
    thinned = 3e-9 * float(np.median(np.diff(truth.stamps)))
    return min(max(MAX_GAP_S, thinned), _MAX_THINNED_GAP_S)


class ProgressiveCalibration:
    """Estimates clock offset and hand-eye again whenever the estimate has grown by a quarter, from eight seconds on."""

    def __init__(self) -> None:
        self._due_s = _CALIBRATE_FROM_S
        self.found: Calibration | None = None

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
            self.found = result


class Comparison:
    """Compares each published pose with truth once both are there; at most 2000 of each wait for the other."""

    def __init__(self) -> None:
        self._pending: deque[tuple[Stamp, Array, Array | None]] = deque(maxlen=_MAX_PENDING)
        self._truth: deque[tuple[Stamp, Array]] = deque(maxlen=_MAX_PENDING)

    def add(self, stamp: Stamp, T_map_camera: Array, covariance: Array | None) -> None:
        """Remember a published pose and its 6 x 6 covariance, None where that is not known."""
        self._pending.append((stamp, T_map_camera, covariance))

    def add_truth(self, stamp: Stamp, T_truth_body: Array) -> None:
        """Remember a true pose; one that is not newer than the last is ignored."""
        if not self._truth or stamp > self._truth[-1][0]:
            self._truth.append((stamp, T_truth_body))

    def forget_before(self, stamp: Stamp) -> None:
        """Forget the published poses before a stamp."""
        self._pending = deque((entry for entry in self._pending if entry[0] >= stamp), maxlen=_MAX_PENDING)

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
        E = se3.inverses(T) @ np.where(valid[:, None, None], T_true, np.eye(4))
        metres = np.linalg.norm(E[:, :3, 3], axis=1)
        degrees = np.degrees(angles_of(E[:, :3, :3]))
        for entry, ok, m, deg in zip(judged, valid, metres, degrees, strict=True):
            if ok:
                yield PoseError(entry[0], float(m), float(deg), *fit.bounds(entry[1], entry[2]))
