"""Clock offset and hand-eye transformation between motion capture and camera, each with its uncertainty.

The clock offset is first found roughly by speeds (`clock_offset`), then everything is estimated in one least-squares
problem (`hand_eye`), which is begun anew as long as the offset moves.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from odom.errors import InputError, check_type
from odom.evaluation.clock_offset import WEAK_CORRELATION, ClockOffset, clock_offset
from odom.evaluation.hand_eye import MINIMUM, REACH_S, HandEye, State
from odom.evaluation.smoothing import smooth
from odom.evaluation.trajectory import Trajectory, as_array, check, have_rotations
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.geometry.rotations import angles_of

_BEGINNINGS = 10
"""Fits at most, each about the offset of the one before: the offset found by speeds may be tens of ms off."""
_SETTLED_S = 0.001
"""A smaller move of the offset needs no new fit: its derivative is taken over tens of milliseconds."""
_WILD = 3.0
"""Truth that turns so many times faster than the camera's 95th percentile has jumped: such frames are left out."""
_SLOW_RAD_S = 0.5
"""Added to that limit, so that truth's own noise is not taken for jumps where the camera hardly turns."""
_UNSURE_M, _UNSURE_RAD = 0.05, np.radians(3.0)
"""Standard deviations of the hand-eye from which on a note warns; smaller warns about usable calibrations."""
LARGEST_OFFSET_S = 4e9
"""More than since 1970; beyond it, stamps of today plus the offset are no 64 bits of nanoseconds."""


@dataclass(frozen=True, eq=False)
class CalibrationOptions:
    """What is known and what is to be estimated.

    `offset_s` and `T_body_camera` (4 x 4, m) impose a value; None has it estimated. `search_s` is how far offsets are
    searched (see `clock_offset`), truth is interpolated between neighbours at most `max_gap_s` apart.

    Raises InputError when a number is not finite, a time negative that cannot be, or `T_body_camera` no rigid motion.
    """

    offset_s: float | None = None
    T_body_camera: Array | None = None
    max_gap_s: float = 0.1
    search_s: float | None = None

    def __post_init__(self) -> None:
        if self.offset_s is not None and not abs(self.offset_s) <= LARGEST_OFFSET_S:
            raise InputError(f"offset_s is {self.offset_s}: give the seconds to add to a stamp of the camera, or None")
        for name, seconds in (("max_gap_s", self.max_gap_s), ("search_s", self.search_s)):
            if seconds is not None and not seconds >= 0.0:
                raise InputError(f"{name} is {seconds}: give seconds, 0 or more")
        if self.T_body_camera is not None:
            object.__setattr__(self, "T_body_camera", _rigid(self.T_body_camera))


def _rigid(T_body_camera: Any) -> Array:
    T = as_array("T_body_camera", T_body_camera, np.float64)
    is_pose = T.shape == (4, 4) and np.isfinite(T).all() and np.allclose(T[3], (0.0, 0.0, 0.0, 1.0))
    if not is_pose or not have_rotations(T[None])[0]:
        raise InputError(
            f"T_body_camera is no rigid motion, but {T.tolist()}: give 4 x 4 finite numbers, a rotation neither "
            "scaled nor mirrored on the left and metres in the last column; the transposed one has them in the last row"
        )
    return T


@dataclass(frozen=True, eq=False)
class Calibration:
    """What relates a body's truth to the camera's estimate, with standard deviations (0: imposed).

    `offset_s` is added to a camera stamp to get the truth's. `hand_eye_sigma` (rho m, phi rad) is in the camera's
    frame; `correlation` is that of the two speeds at the offset (NaN when it was imposed). A weak one leaves the offset
    anywhere in the range that was searched.
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

    Of either in several segments the longest is taken. Raises InputError when too few poses match in time, none of the
    two moves at all, or one is no rigid motion.
    """
    check_type("options", options, CalibrationOptions | None, "CalibrationOptions(offset_s=...), or None")
    options = options or CalibrationOptions()
    for name, given in (("estimate", estimate), ("truth", truth)):
        check(name, given)
    estimate, truth = estimate.longest_segment(), truth.longest_segment()
    if options.offset_s is None:
        clock = clock_offset(estimate, truth, options.max_gap_s, options.search_s)
    else:
        clock = ClockOffset(options.offset_s, float("nan"))
    truth = smooth(truth)
    free = np.repeat([options.T_body_camera is None, True, options.offset_s is None], [6, 6, 1])
    try:
        state, sigma = _fitted(estimate, truth, clock, options, free)
    except np.linalg.LinAlgError:
        raise InputError(
            "estimate and truth do not move: no clock offset or hand-eye can be found; walk and turn the camera"
        ) from None
    return Calibration(
        offset_s=state.offset_s,
        offset_sigma_s=max(float(sigma[12]), clock.searched_s if _is_guess(clock) else 0.0),
        T_body_camera=state.T_body_camera,
        hand_eye_sigma=sigma[:6],
        T_world_odom=state.T_world_odom,
        correlation=clock.correlation,
        notes=_notes(sigma, clock),
    )


def _fitted(
    estimate: Trajectory, truth: Trajectory, clock: ClockOffset, options: CalibrationOptions, free: Mask
) -> tuple[State, Array]:
    """Return the solution and its standard deviations, fitted anew until the offset stays or turns back.

    About an offset that is a guess there is one fit: further ones may lead anywhere.
    """
    offset_s, moved_s = clock.seconds, 0.0
    begun: State | None = None
    for _ in range(1 if _is_guess(clock) else _BEGINNINGS):
        matched = estimate.take(_matched(estimate, truth, offset_s, options.max_gap_s))
        state, sigma = HandEye(matched, truth, offset_s, options.T_body_camera, free).solve(begun)
        before_s, moved_s = moved_s, state.offset_s - offset_s
        offset_s, begun = state.offset_s, state
        if abs(moved_s) < _SETTLED_S or moved_s * before_s < 0.0:
            break
    return state, sigma


def _matched(estimate: Trajectory, truth: Trajectory, offset_s: float, max_gap_s: float) -> Mask:
    """Return which poses have truth that does not jump, at the offset and within reach before and after it."""
    if len(estimate) < MINIMUM:
        raise InputError(f"{len(estimate)} estimated poses: a calibration needs {MINIMUM} at least")
    times = [estimate.stamps + round((offset_s + shift) * 1e9) for shift in (-REACH_S, 0.0, REACH_S)]
    sooner, now, later = (truth.at(stamps, max_gap_s) for stamps in times)
    valid = sooner[1] & now[1] & later[1]
    turned = _turns(estimate.T_world_body[:-1], estimate.T_world_body[1:])
    fastest = _WILD * float(np.percentile(turned / np.diff(estimate.stamps), 95)) * 1e9
    for before, after in ((sooner[0], now[0]), (now[0], later[0])):
        index = np.flatnonzero(valid)
        valid[index] = _turns(before[index], after[index]) < (fastest + _SLOW_RAD_S) * REACH_S
    if valid.sum() < MINIMUM:
        raise InputError(f"{valid.sum()} poses match truth in time: a calibration needs {MINIMUM} at least")
    return valid


def _turns(before: Array, after: Array) -> Array:
    return angles_of((se3.inverses(before) @ after)[:, :3, :3])


def _is_guess(clock: ClockOffset) -> bool:
    return clock.correlation < WEAK_CORRELATION


def _notes(sigma: Array, clock: ClockOffset) -> tuple[str, ...]:
    notes = []
    if _is_guess(clock):
        notes.append(
            f"the speeds correlate only {clock.correlation:.2f}: the clock offset is a guess; "
            "turn the camera briskly a few times in the recording"
        )
    unsure_m = np.flatnonzero(sigma[:3] > _UNSURE_M)
    if len(unsure_m):
        names = ", ".join(f"{'xyz'[i]} to {sigma[i]:.2f} m" for i in unsure_m)
        notes.append(
            f"hand-eye translation is known only in {names}: the camera must turn about two axes at least; "
            "what its turns do not show is taken as 0 m"
        )
    if (sigma[3:6] > _UNSURE_RAD).any():
        notes.append(
            f"hand-eye rotation is known only to {np.degrees(sigma[3:6].max()):.0f} deg: "
            "neither turns nor the shape of the path settle it"
        )
    return tuple(notes)
