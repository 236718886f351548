"""When the messages of a recording that is played in real time are due."""

from odom.frame import Stamp
from odom.wire.pairing import LEAP_NS

_HEAD_START_S = 0.1
"""Seconds between the calibration and the first image of a recording that is played in real time: consumers compute the
table of the lens meanwhile. Less: the first images wait, and at a high rate some are lost."""
_LONGEST_PAUSE_NS = 10_000_000_000
"""A pause of a recording is waited for up to so long; longer ones, as where a clock was set, are skipped."""


class Pace:
    """The pace of stamps at `rate` times that of the clock; where they leap, as when a clock is set, it begins anew."""

    def __init__(self, rate: float) -> None:
        self._ns_per_s = 1e9 * rate
        self._begun, self._first = 0.0, Stamp(0)
        self._last: Stamp | None = None

    def due(self, stamp: Stamp, now: float) -> float:
        """Return when the next message is due, in seconds of the clock that says `now`."""
        if self._last is None or not -LEAP_NS <= stamp - self._last <= _LONGEST_PAUSE_NS:
            self._begun, self._first = now + (_HEAD_START_S if self._last is None else 0.0), stamp
        self._last = stamp
        return self._begun + (stamp - self._first) / self._ns_per_s
