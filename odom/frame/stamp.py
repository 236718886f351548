"""Time stamps: integer nanoseconds since the Unix epoch, so that equality and order are exact."""

from typing import NewType

Stamp = NewType("Stamp", int)
"""Nanoseconds since the Unix epoch."""


def from_seconds(seconds: float | str) -> Stamp:
    """Return the stamp of `seconds`; decimal text is converted without passing through a float.

    Raises ValueError for text that is not a decimal number.
    """
    if isinstance(seconds, float | int):
        return Stamp(round(seconds * 1e9))
    text = seconds.strip()
    sign = -1 if text.startswith("-") else 1
    whole, _, fraction = text.lstrip("+-").partition(".")
    return Stamp(sign * (int(whole or "0") * 1_000_000_000 + int((fraction + "0" * 9)[:9])))


def to_seconds(stamp: Stamp) -> float:
    """Return the stamp in seconds (float64: about .2 microseconds of resolution today)."""
    return stamp * 1e-9
