"""The offset between two clocks, from the angular speed of one body seen by both.

Angular speed is the same for every frame fixed to a rigid body and in every world, so neither the hand-eye
transformation nor the world alignment need be known; compare P. Furgale et al., "Unified temporal and spatial
calibration for multi-sensor systems", IROS 2013. Of a body that does not turn (a camera on a rail) linear speed is.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.geometry.rotations import angles_of

_STEP_S = 0.005
"""Grid on which the speeds are compared; the peak is interpolated, so a finer grid only costs time."""
_MINIMUM_OVERLAP_S = 2.0
"""Time in common, at least a quarter and at most half of the shorter one: less lets chance correlations win."""
_USUAL_SEARCH_S = 5.0
"""How far clocks set by hand or network differ at most; a wider search meets more chance correlations."""
_FASTEST = 1.5
"""Speeds are cut at so many times the 95th percentile: a marker body that jumps must not outshine the motion."""
WEAK_CORRELATION = 0.5
"""Correlation of the speeds below which they may agree by chance, and another peak be the true one."""


@dataclass(frozen=True)
class ClockOffset:
    """`seconds` to add to the estimate's stamps to get the truth's; `correlation` (-1 .. 1) at the peak.

    `searched_s` is the standard deviation (s) of an offset anywhere in the range that was searched.
    """

    seconds: float
    correlation: float
    searched_s: float = 0.0


def angular(motion: Array) -> Array:
    """Return the angles (n, rad) of n relative poses."""
    return angles_of(motion[:, :3, :3])


def linear(motion: Array) -> Array:
    """Return the lengths (n, m) of n relative poses."""
    return np.asarray(np.linalg.norm(motion[:, :3, 3], axis=1))


def speed(
    trajectory: Trajectory, size: Callable[[Array], Array], window_s: float, max_gap_s: float
) -> tuple[int, Array, Mask]:
    """Return the speed (rad/s or m/s) on a grid of 5 ms: the stamp it starts at (ns), values, and which are valid.

    Each value is the mean over `window_s` around its time; `size` is `angular` or `linear`.
    """
    half = round(window_s * 5e8)
    start = int(trajectory.stamps[0]) + half
    count = max(int((int(trajectory.stamps[-1]) - half - start) // int(_STEP_S * 1e9)) + 1, 0)
    grid = start + np.arange(count, dtype=np.int64) * np.int64(_STEP_S * 1e9)
    before, valid_before = trajectory.at(grid - half, max_gap_s)
    after, valid_after = trajectory.at(grid + half, max_gap_s)
    valid = valid_before & valid_after
    values = np.zeros(count)
    values[valid] = size(se3.inverses(before[valid]) @ after[valid]) / window_s
    return start, values, valid


def clock_offset(
    estimate: Trajectory, truth: Trajectory, max_gap_s: float = 0.1, search_s: float | None = None
) -> ClockOffset:
    """Return the offset with the highest normalised cross-correlation of the two angular speeds.

    Where that is weak it is the one of the linear speeds, if these agree better. Searched within `search_s`; by default
    within 5 s, or over every overlap when the two clocks share no epoch. Good to a few milliseconds,
    of a gentle motion to some tens; `mocap_calibration` refines it. Raises InputError when no offset lets the two
    overlap by two seconds.
    """
    if len(estimate) < 3 or len(truth) < 3:
        raise InputError(f"{len(estimate)} estimated and {len(truth)} true poses: too few for a time offset")
    by_turns = _offset_by(angular, estimate, truth, max_gap_s, search_s)
    if by_turns.correlation >= WEAK_CORRELATION:
        return by_turns
    by_moves = _offset_by(linear, estimate, truth, max_gap_s, search_s)
    return max(by_turns, by_moves, key=lambda found: found.correlation)


def _offset_by(
    size: Callable[[Array], Array], estimate: Trajectory, truth: Trajectory, max_gap_s: float, search_s: float | None
) -> ClockOffset:
    window_s = max(float(np.median(np.diff(t.stamps))) * 1e-9 for t in (estimate, truth))
    start_a, a, mask_a = speed(estimate, size, window_s, max(max_gap_s, 3 * window_s))
    start_b, b, mask_b = speed(truth, size, window_s, max_gap_s)
    limit = _FASTEST * min(float(np.percentile(v[m], 95)) if m.any() else 0.0 for v, m in ((a, mask_a), (b, mask_b)))
    a, b = np.minimum(a, limit), np.minimum(b, limit)
    # at lag k, a[i] is paired with b[i + k]
    from scipy.signal import correlate, correlation_lags  # takes half a second, which a starting viewer does not have

    def paired(a: NDArray[np.generic], b: NDArray[np.generic]) -> Array:
        return np.asarray(correlate(b.astype(float), a.astype(float), method="fft"))

    overlap = np.rint(paired(mask_a, mask_b))
    count = np.maximum(overlap, 1.0)
    sum_a, sum_b = paired(a * mask_a, mask_b), paired(mask_a, b * mask_b)
    square_a, square_b = paired(a**2 * mask_a, mask_b), paired(mask_a, b**2 * mask_b)
    covariance = paired(a * mask_a, b * mask_b) - sum_a * sum_b / count
    spread = np.maximum(square_a - sum_a**2 / count, 0) * np.maximum(square_b - sum_b**2 / count, 0)
    offsets = correlation_lags(len(b), len(a)) * _STEP_S + (start_b - start_a) * 1e-9
    if search_s is None:
        apart = truth.stamps[0] > estimate.stamps[-1] or truth.stamps[-1] < estimate.stamps[0]
        search_s = np.inf if apart else _USUAL_SEARCH_S
    shorter = min(mask_a.sum(), mask_b.sum())
    needed = max(min(_MINIMUM_OVERLAP_S / _STEP_S, shorter / 2), shorter / 4)
    allowed = (overlap >= max(needed, 3)) & (np.abs(offsets) <= search_s)
    if not allowed.any():
        raise InputError("no time offset makes estimate and truth overlap: are they of the same recording?")
    value = np.where(allowed, covariance / np.sqrt(np.maximum(spread, 1e-12)), -np.inf)
    peak = int(np.argmax(value))
    before, after = value[max(peak - 1, 0)], value[min(peak + 1, len(value) - 1)]
    curvature = before - 2 * value[peak] + after
    fraction = 0.5 * (before - after) / curvature if np.isfinite(curvature) and curvature < 0 else 0.0
    searched_s = float(np.ptp(offsets[allowed])) / 12.0**0.5
    return ClockOffset(float(offsets[peak] + fraction * _STEP_S), float(value[peak]), searched_s)
