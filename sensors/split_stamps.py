"""Stamps as programs write them that put seconds and nano- or microseconds side by side: two whole numbers."""

import logging
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from odom.frame import Stamp, stamp_of

log = logging.getLogger(__name__)

SECOND = 1_000_000_000
"""Nanoseconds in a second."""
_WITH_POINT = re.compile(r"(\d+)\.(\d+)")
_SINCE_1970_DIGITS = 10
"""Digits of seconds since 1970, from 2001 to 2286."""
_NANOSECOND_DIGITS, _MICROSECOND_DIGITS = 9, 6
"""Digits of the part of a second that stands behind its seconds as a number of its own."""
_NEAR, _MOSTLY = 0.5, 0.8
"""Stamps step evenly where so large a share of their steps is that near to the middle one, as a share of it. In those
of a camera nine in ten are; of fractions that are read as numbers, or numbers as fractions, seven. Chosen by hand."""


def are_seconds_and_parts(seconds: Sequence[str], parts: Sequence[str]) -> bool:
    """Return whether two numbers of each name are seconds since 1970 and the nano- or microseconds behind them.

    They are not where one time stands before a counter.
    """
    are_seconds = all(len(number) == _SINCE_1970_DIGITS and number[0] != "0" for number in seconds)
    digits = max(map(len, parts))
    return are_seconds and digits <= _NANOSECOND_DIGITS and (len(set(seconds)) > 1 or digits == _NANOSECOND_DIGITS)


def stamps_of_parts(seconds: Sequence[str], parts: Sequence[str]) -> list[Stamp]:
    """Return the stamps of seconds and parts, which are nanoseconds where one has more digits than microseconds."""
    part_ns = 1 if max(map(len, parts)) > _MICROSECOND_DIGITS else 1_000
    return [Stamp(int(s) * SECOND + int(part) * part_ns) for s, part in zip(seconds, parts, strict=True)]


def without_leading_zeros(stamps: Sequence[str]) -> list[Stamp] | None:
    """Return the stamps of `SECONDS.PART` where the part is a number written without leading zeros, else None.

    So 45 ms behind 5 s, `5.045000000`, become `5.45000000`. It is where the parts differ in their count of digits and
    stamps step evenly only when read so.
    """
    found = [match.groups() for stamp in stamps if (match := _WITH_POINT.fullmatch(stamp))]
    if not found or len(found) < len(stamps):
        return None
    seconds, parts = zip(*found, strict=True)
    digits = set(map(len, parts))
    if len(digits) == 1 or max(digits) > _NANOSECOND_DIGITS:
        return None
    whole = stamps_of_parts(seconds, parts)
    evenness = _evenness(whole)
    return whole if evenness > _MOSTLY and evenness > _evenness([stamp_of(stamp)[0] for stamp in stamps]) else None


def tell_without_zeros(path: Path) -> None:
    """Log that the stamps in a file or folder are read so."""
    log.warning(
        "%s: the numbers behind the points of its stamps are taken for whole nano- or microseconds without leading "
        "zeros: as fractions they do not step evenly; write 5.045 for 45 ms behind 5 s", path,
    )  # fmt: skip


def _evenness(stamps: Sequence[Stamp]) -> float:
    """Return the share of the steps from stamp to stamp that are near to the middle one."""
    steps = np.diff(np.sort(stamps))
    middle = np.median(steps)
    return float(np.mean(np.abs(steps - middle) <= _NEAR * middle))
