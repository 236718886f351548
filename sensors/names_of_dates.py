"""Names of images that hold a date and a time of day, such as `2011-05-10 12:38:22.175304` or `20110510_123822_175`."""

import re
from collections.abc import Sequence
from datetime import datetime
from itertools import pairwise
from statistics import median

from odom.frame import Stamp
from sensors.split_stamps import SECOND

_DATE = re.compile(r"(?<!\d)((?:19|20)\d\d)\D?(\d\d)\D?(\d\d)\D{0,3}(\d\d)\D?(\d\d)\D?(\d\d)(?:(\D?)(\d+))?\D*\Z")
_PART_DIGITS = (3, 6, 9)
"""Digits of milli-, micro- and nanoseconds, the most that one of the names has; others are a number of its own."""


def stamps_of_dates(stems: Sequence[str]) -> list[Stamp] | None:
    """Return the stamps of names that all end with a date, a time of day in UTC, and a part of a second or none.

    None where one does not, or where a counter stands behind the time.
    """
    found = [match.groups() for stem in stems if (match := _DATE.search(stem))]
    if not found or len(found) < len(stems):
        return None
    try:
        seconds = [
            int(datetime.strptime("".join((*date, "+0000")), "%Y%m%d%H%M%S%z").timestamp()) for *date, _, _ in found
        ]
    except ValueError:
        return None
    parts = [part or "0" for *_, part in found]
    if all(sign == "." for *_, sign, _ in found):
        parts = [part.ljust(9, "0") for part in parts]
    digits = max(map(len, parts))
    if digits > 1 and (digits not in _PART_DIGITS or _counts(seconds, list(map(int, parts)))):
        return None
    return [Stamp(s * SECOND + int(part) * 10 ** (9 - digits)) for s, part in zip(seconds, parts, strict=True)]


def _counts(seconds: list[int], parts: list[int]) -> bool:
    """Return whether numbers behind times of day go up by one from image to image, as counters do."""
    numbers = [part for _, part in sorted(zip(seconds, parts, strict=True))]
    return len(numbers) > 1 and median(later - number for number, later in pairwise(numbers)) == 1
