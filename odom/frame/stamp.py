"""Time stamps: integer nanoseconds since the Unix epoch, so that equality and order are exact."""

from decimal import Decimal, InvalidOperation
from typing import Any, NewType

import numpy as np

from odom.errors import InputError

Stamp = NewType("Stamp", int)
Stamp.__doc__ = "A whole number of nanoseconds since 1970, an int; `from_seconds` makes it of seconds."

_LATEST_S = 9_000_000_000
"""In the year 2255; 64 bits of nanoseconds end in 2262."""
_COARSEST_S = 1e-4
"""Seconds between neighbouring numbers of a type from which on it is too coarse for stamps: a camera that is moved by
hand moves .1 mm in that time."""
_UNITS = ((18, "nanoseconds", 9), (15, "microseconds", 6), (12, "milliseconds", 3))
"""A number of so many digits or more before the point is a time since 1970 in this unit, so many digits finer than a
second."""


def from_seconds(seconds: float | str) -> Stamp:
    """Return the stamp of `seconds`. Decimal text is exact; a float of today's date is good to 0.2 microseconds.

    >>> from_seconds("1305031102.175304")
    1305031102175304000

    Raises ValueError for what is not a finite number of seconds, or beyond the year 2255, or of too few digits, as a
    float32 of today's date.
    """
    if isinstance(seconds, str):
        return _exact(_decimal(seconds), seconds)
    if isinstance(seconds, np.floating) and (step := float(np.spacing(abs(seconds)))) > _COARSEST_S:
        raise ValueError(f"{seconds!r} seconds are known to {step:g} s only: give float64 or text from the beginning")
    if not abs(seconds) <= _LATEST_S:
        raise ValueError(f"{seconds!r} seconds are no time stamp: give seconds since 1970")
    return Stamp(round(float(seconds) * 1e9))


def stamp_of(text: str) -> tuple[Stamp, str]:
    """Return the stamp that a file or a name holds, and the unit it is in by its digits before the point.

    >>> stamp_of("1305031102175304"), stamp_of("1.305031102175304e18")
    ((1305031102175304000, 'microseconds'), (1305031102175304000, 'nanoseconds'))

    Raises ValueError for what is no number, or no time in that unit before the year 2255.
    """
    value = _decimal(text)
    digits = value.adjusted() + 1 if value.is_finite() else 0
    for least, unit, finer in _UNITS:
        if digits >= least:
            return _exact(value.scaleb(-finer), text), unit
    return _exact(value, text), "seconds"


def _decimal(text: str) -> Decimal:
    try:
        return Decimal(text.strip())
    except InvalidOperation:
        raise ValueError(f"{text!r} is not a number of seconds") from None


def _exact(seconds: Decimal, given: str) -> Stamp:
    """Return the stamp of so many seconds, refused as the text `given` for them."""
    if not seconds.is_finite() or abs(seconds) > _LATEST_S:
        raise ValueError(f"{given!r} seconds are no time stamp: give seconds since 1970")
    return Stamp(int((seconds * 1_000_000_000).to_integral_value()))


def is_number(text: str) -> bool:
    """Return whether a text is a number, as a stamp and the numbers of a pose are, and a name is not."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def to_seconds(stamp: Stamp) -> float:
    """Return the stamp in seconds (float64: about .2 microseconds of resolution today)."""
    return stamp * 1e-9


def seconds_text(stamp: Stamp) -> str:
    """Return the stamp in seconds as exact decimal text, of which `from_seconds` makes the stamp again.

    >>> seconds_text(Stamp(1305031102175304000))
    '1305031102.175304000'
    """
    seconds, nanoseconds = divmod(abs(stamp), 1_000_000_000)
    return f"{'-' if stamp < 0 else ''}{seconds}.{nanoseconds:09d}"


def checked_stamp(name: str, value: Any) -> Stamp:
    """Return `value` as a stamp; raises InputError, calling it `name`, unless it is a whole number of nanoseconds."""
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if is_whole and abs(int(value)) <= _LATEST_S * 1_000_000_000:
        return Stamp(int(value))
    raise InputError(
        f"{name} is {value!r} ({type(value).__name__}): give whole nanoseconds since 1970; "
        "odom.from_seconds(...) makes them of seconds"
    )
