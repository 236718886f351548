"""Maps a device's clock to the host's: follows offset and drift, but not the jitter of the transport.

A time stamp of the device and the host's time at receipt differ by offset + drift * time + delay, and only the delay
varies from one to the next. In every second the pair with the least delay is kept; the line through those (Theil-Sen:
the median of all pairwise slopes, H. Theil 1950) follows offset and drift, however late single packets are.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from odom.frame import Stamp

WINDOW = 120
"""Best pairs (one per second) that the line is fitted to: more are steadier, fewer follow a warming oscillator."""
FIT_AFTER = 10
"""Best pairs needed before the drift is estimated (before, it is 0): with fewer, delays are taken for drift."""
STEP_NS = 500_000_000
"""A larger change of offset (ns) means that a clock was set: smaller takes delays of a busy machine for that."""
MAX_DRIFT = 5e-4
"""Largest drift believed, seconds per second: ten times what the worst quartz oscillators are specified with."""
LATE_NS = 1_000_000_000
"""Nanoseconds (of the device) after which a lasting change of offset means that a clock was set."""
TICK_TOLERANCE = 0.1
"""Relative error up to which a measured unit is a known one: the nearest two known units differ by a quarter."""
KNOWN_TICKS_NS = (1e3, 1e3 / 60, 125e3, 100e3, 1.0, 1e6)
"""Units that drivers really stamp in: microseconds (OpenNI's), the Kinect v1's 60 MHz (libfreenect up to 0.5.3),
the Kinect v2's 0.125 ms (documented as 0.1 ms), nanoseconds, milliseconds."""


def tick_length(ticks: int, elapsed_ns: int) -> float | None:
    """Return the known unit, in ns, that brings `ticks` nearest to `elapsed_ns`; None when none is within 10 %."""
    if ticks <= 0 or elapsed_ns <= 0:
        return None
    measured = elapsed_ns / ticks
    nearest = min(KNOWN_TICKS_NS, key=lambda known: abs(np.log(known / measured)))
    return nearest if abs(nearest / measured - 1) < TICK_TOLERANCE else None


@dataclass
class ClockMapping:
    """The running estimate of `host = device + offset + drift * (device - reference)`.

    `resets` counts how often a clock was found to have been set, which starts the estimate anew.
    """

    resets: int = 0
    _best: deque[tuple[int, int, int]] = field(default_factory=lambda: deque(maxlen=WINDOW))
    _second: int | None = None
    _late_since: int | None = None
    _reference_ns: int = 0
    _offset_ns: float = 0.0
    _drift: float = 0.0

    def observe(self, device_ns: int, host_ns: int, delay_ns: int | None = None) -> None:
        """Take in one pair of times in ns; `delay_ns` is the round trip's, if known, else judged by the offset."""
        offset = host_ns - device_ns
        cost = offset if delay_ns is None else delay_ns
        if self._best and abs(offset - self.offset_ns(device_ns)) > STEP_NS:
            if self._is_delay(device_ns, offset):
                return
            self.resets += 1
            self._best.clear()
        self._late_since = None
        second = device_ns // 1_000_000_000
        if not self._best or second != self._second:
            self._second = second
            self._best.append((device_ns, offset, cost))
        elif cost < self._best[-1][2]:
            self._best[-1] = (device_ns, offset, cost)
        else:
            return
        self._fit()

    def _is_delay(self, device_ns: int, offset: int) -> bool:
        """Return whether a pair far off the line came late; otherwise a clock was set, or the device's began anew.

        A delay lasts under a second.
        """
        if offset < self.offset_ns(device_ns) or device_ns < self._best[-1][0] - STEP_NS:
            return False
        if self._late_since is None:
            self._late_since = device_ns
        return 0 <= device_ns - self._late_since < LATE_NS

    def _fit(self) -> None:
        device = np.array([pair[0] - self._best[0][0] for pair in self._best], dtype=np.float64)
        offset = np.array([pair[1] - self._best[0][1] for pair in self._best], dtype=np.float64)
        if len(device) >= FIT_AFTER:
            first, second = np.triu_indices(len(device), 1)
            slopes = (offset[second] - offset[first]) / (device[second] - device[first])
            self._drift = float(np.clip(np.median(slopes), -MAX_DRIFT, MAX_DRIFT))
            start = float(np.median(offset - self._drift * device))
        else:
            self._drift = 0.0
            start = float(offset[np.argmin([pair[2] for pair in self._best])])
        self._reference_ns = self._best[0][0]
        self._offset_ns = self._best[0][1] + start

    def offset_ns(self, device_ns: int) -> float:
        """Return host minus device time at the device's time `device_ns`, in ns."""
        return self._offset_ns + self._drift * (device_ns - self._reference_ns)

    def to_host(self, device_ns: int) -> Stamp:
        """Return the host's time of the device's time `device_ns`; `observe` must have been called before."""
        return Stamp(device_ns + round(self.offset_ns(device_ns)))

    @property
    def drift_ppm(self) -> float:
        """How much faster the host's clock runs than the device's, in millionths."""
        return self._drift * 1e6


@dataclass
class Unwrap:
    """Makes a counter of `bits` bits that wraps round into one that does not; steps back of less than half are kept."""

    bits: int
    _high: int = 0
    _last: int | None = None

    def __call__(self, value: int) -> int:
        """Return `value` with the wraps so far added."""
        span = 1 << self.bits
        if self._last is not None:
            if value - self._last < -span // 2:
                self._high += span
            elif value - self._last > span // 2 and self._high:
                return value + self._high - span
        self._last = value
        return value + self._high
