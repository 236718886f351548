"""Clock offset and hand-eye transformation between motion capture and camera, each with its uncertainty.

The clock offset is first found to a few milliseconds by angular speeds (`clock_offset`), then everything is estimated
in one least-squares problem (`hand_eye`).
"""

from dataclasses import dataclass

import numpy as np

from odom.errors import InputError
from odom.evaluation.clock_offset import ClockOffset, clock_offset
from odom.evaluation.hand_eye import MINIMUM, HandEye
from odom.evaluation.smoothing import smooth
from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.geometry.rotations import angles_of

_REACH_S = 0.04
"""A pose needs truth this long before and after it: longer than the offset may move while it is refined."""
_WILD = 3.0
"""Truth that turns so many times faster than the camera's 95th percentile has jumped: such frames are left out."""
_SLOW_RAD_S = 0.5
"""Added to that limit, so that truth's own noise is not taken for jumps where the camera hardly turns."""
_UNSURE_M, _UNSURE_RAD = 0.05, np.radians(3.0)
"""Standard deviations of the hand-eye from which on a note warns; smaller warns about usable calibrations."""
_WEAK_CORRELATION = 0.5
"""Correlation of the angular speeds below which a note calls the offset a guess."""


@dataclass(frozen=True, eq=False)
class CalibrationOptions:
    """What is known and what is to be estimated.

    `offset_s` and `T_body_camera` impose a value; None has it estimated.
    """

    offset_s: float | None = None
    T_body_camera: Array | None = None
    max_gap_s: float = 0.1
    search_s: float | None = None


@dataclass(frozen=True, eq=False)
class Calibration:
    """What relates a body's truth to the camera's estimate, with standard deviations (0: imposed).

    `offset_s` is added to a camera stamp to get the truth's. `hand_eye_sigma` (rho m, phi rad) is in the camera's
    frame; `correlation` is that of the two angular speeds at the offset (NaN when it was imposed).
    """

    offset_s: float
    offset_sigma_s: float
    T_body_camera: Array
    hand_eye_sigma: Array
    T_world_odom: Array
    correlation: float
    notes: tuple[str, ...]

    def camera_truth(self, truth_of_body: Trajectory) -> Trajectory:
        """Return the truth of the camera's optical frame on the camera's clock."""
        return truth_of_body.delayed(-self.offset_s).of_body(self.T_body_camera)


def calibrate(estimate: Trajectory, truth: Trajectory, options: CalibrationOptions | None = None) -> Calibration:
    """Return the calibration of a camera's `estimate` against the `truth` of a body fixed to the camera.

    Raises InputError when too few poses match in time, or none of the two moves at all.
    """
    options = options or CalibrationOptions()
    estimate = estimate.longest_segment()
    if options.offset_s is None:
        clock = clock_offset(estimate, truth, options.max_gap_s, options.search_s)
    else:
        clock = ClockOffset(options.offset_s, float("nan"))
    truth = smooth(truth)
    free = np.repeat([options.T_body_camera is None, True, options.offset_s is None], [6, 6, 1])
    matched = estimate.take(_matched(estimate, truth, clock.seconds, options.max_gap_s))
    try:
        state, sigma = HandEye(matched, truth, clock.seconds, options.T_body_camera, free).solve()
    except np.linalg.LinAlgError:
        raise InputError(
            "estimate and truth do not move: no clock offset or hand-eye can be found; walk and turn the camera"
        ) from None
    return Calibration(
        offset_s=state.offset_s,
        offset_sigma_s=float(sigma[12]),
        T_body_camera=state.T_body_camera,
        hand_eye_sigma=sigma[:6],
        T_world_odom=state.T_world_odom,
        correlation=clock.correlation,
        notes=_notes(sigma, clock),
    )


def _matched(estimate: Trajectory, truth: Trajectory, offset_s: float, max_gap_s: float) -> Mask:
    """Return which poses have truth that does not jump, at the offset and within reach before and after it."""
    if len(estimate) < MINIMUM:
        raise InputError(f"{len(estimate)} estimated poses: a calibration needs {MINIMUM} at least")
    times = [estimate.stamps + round((offset_s + shift) * 1e9) for shift in (-_REACH_S, 0.0, _REACH_S)]
    sooner, now, later = (truth.at(stamps, max_gap_s) for stamps in times)
    valid = sooner[1] & now[1] & later[1]
    turned = _turns(estimate.T_world_body[:-1], estimate.T_world_body[1:])
    fastest = _WILD * float(np.percentile(turned / np.diff(estimate.stamps), 95)) * 1e9
    for before, after in ((sooner[0], now[0]), (now[0], later[0])):
        index = np.flatnonzero(valid)
        valid[index] = _turns(before[index], after[index]) < (fastest + _SLOW_RAD_S) * _REACH_S
    if valid.sum() < MINIMUM:
        raise InputError(f"{valid.sum()} poses match truth in time: a calibration needs {MINIMUM} at least")
    return valid


def _turns(before: Array, after: Array) -> Array:
    return angles_of((se3.inverses(before) @ after)[:, :3, :3])


def _notes(sigma: Array, clock: ClockOffset) -> tuple[str, ...]:
    notes = []
    if clock.correlation < _WEAK_CORRELATION:
        notes.append(
            f"the angular speeds correlate only {clock.correlation:.2f}: the clock offset is a guess; "
            "turn the camera briskly a few times in the recording"
        )
    unsure_m = np.flatnonzero(sigma[:3] > _UNSURE_M)
    if len(unsure_m):
        names = ", ".join(f"{'xyz'[i]} to {sigma[i]:.2f} m" for i in unsure_m)
        notes.append(f"hand-eye translation is known only in {names}: the camera must turn about two axes at least")
    if (sigma[3:6] > _UNSURE_RAD).any():
        notes.append(
            f"hand-eye rotation is known only to {np.degrees(sigma[3:6].max()):.0f} deg: "
            "neither turns nor the shape of the path settle it"
        )
    return tuple(notes)
