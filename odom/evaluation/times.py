"""Stamps of a clock that leapt back: the same moment comes twice, and poses sorted by stamp jump between both."""

import numpy as np
from numpy.typing import NDArray

from odom.geometry.arrays import Mask

Stamps = NDArray[np.int64]

_LEAP_NS = 1_000_000_000
"""The odometry, too, takes stamps that step back by more than a second for a new time, and refuses a smaller step."""
_SHORTEST = 10
"""Of a file with fewer stamps between two leaps, on average, no clock made the order: it is in none."""


def times_of(stamps: Stamps) -> Stamps:
    """Return the number of the time that each of n stamps (ns), in the order in which they came, belongs to.

    A leap back by more than a second begins a new time. All are of one time, 0, where times do not overlap, so that
    each moment comes once, and where the stamps are in no order at all.
    """
    numbers = np.concatenate([np.zeros(min(1, len(stamps)), np.int64), np.cumsum(np.diff(stamps) < -_LEAP_NS)])
    if not numbers.any() or len(stamps) < _SHORTEST * (numbers[-1] + 1):
        return np.zeros_like(numbers)
    earliest, latest = _ends(stamps, numbers)
    order = np.argsort(earliest)
    overlap = earliest[order][1:] <= np.maximum.accumulate(latest[order])[:-1]
    return numbers if overlap.any() else np.zeros_like(numbers)


def of_one_time(stamps: Stamps, beside: Stamps | None = None) -> Mask:
    """Return which of n stamps (ns) are of one time (see `times_of`): of that with the most of them.

    With the stamps of another trajectory `beside`, of that which lasts the longest beside it.
    """
    numbers = times_of(stamps)
    if not numbers.any():
        return np.ones(len(stamps), dtype=np.bool_)
    shares = np.bincount(numbers)
    if beside is not None and len(beside):
        earliest, latest = _ends(stamps, numbers)
        shares = np.minimum(latest, beside.max()) - np.maximum(earliest, beside.min())
    return np.asarray(numbers == np.argmax(shares))


def _ends(stamps: Stamps, numbers: Stamps) -> tuple[Stamps, Stamps]:
    """Return the earliest and the latest stamp of each time, by the `numbers` (n) of the times."""
    first = np.flatnonzero(np.diff(numbers, prepend=-1))
    return np.minimum.reduceat(stamps, first), np.maximum.reduceat(stamps, first)


def are_taken(stamps: Stamps, by: Stamps) -> Mask:
    """Return which of n stamps lie where those of a trajectory, increasing, follow one another frame by frame."""
    if len(by) < 2:
        return np.isin(stamps, by)
    right = np.clip(np.searchsorted(by, stamps), 1, len(by) - 1)
    periods = np.diff(by)
    is_between = (stamps > by[0]) & (stamps < by[-1]) & (periods[right - 1] < 1.5 * np.median(periods))
    return np.asarray(is_between | np.isin(stamps, by))


def leap_note(kept: Mask) -> str | None:
    """Return in words that of all poses only those `kept` are of one time; None where all are."""
    if kept.all():
        return None
    return (
        "the clock leapt back by more than a second, so that moments come twice: of "
        f"{len(kept)} poses, {np.count_nonzero(kept)} from one time without a leap are taken"
    )
