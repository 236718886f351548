"""When a frame was really taken: a camera's own clock is steady, the stamps that a host gives its images are not.

The stamps of a Kinect's images jitter by milliseconds about its steady period; between two frames that is a tenth of
the motion. A straight line through the last stamps gives the steady time of each. Whatever depends on velocity is
computed in steady time, and only what is published is carried to the stamp itself.
"""

from dataclasses import dataclass, replace
from typing import NewType

import numpy as np

from odom.frame import Stamp
from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Array

SteadyStamp = NewType("SteadyStamp", int)
"""Nanoseconds since the Unix epoch by the camera's steady clock, in contrast to a `Stamp` as it was sent."""


@dataclass(frozen=True)
class StampClock:
    """A stream's clock after its newest stamp: `stamps` (ns) are the last ones without a gap.

    The newest stamp is `late_s` later than its steady time, known with one sigma of `sigma_s`; `period_s` is the
    stream's period and `jitter_s` one sigma of a single stamp, 0 where unknown. Where stamps are not multiples of a
    period apart they are taken as they are.
    """

    stamps: tuple[Stamp, ...] = ()
    late_s: float = 0.0
    sigma_s: float = 0.0
    period_s: float = 0.0
    jitter_s: float = 0.0

    @property
    def steady(self) -> SteadyStamp:
        """The steady time of the newest stamp."""
        return SteadyStamp(self.stamps[-1] - round(self.late_s * 1e9))

    @property
    def _longest_gap_s(self) -> float:
        """The longest time to the next stamp that is no gap; after a gap, any period that a stream may have."""
        if len(self.stamps) < 2:
            return TUNING.clock_slowest_s
        return max(TUNING.clock_longest_gap_s, TUNING.clock_longest_gap_periods * self.period_s)

    def after(self, stamp: Stamp) -> "StampClock":
        """Return the clock after one more stamp."""
        if not self.stamps or not 0 < stamp - self.stamps[-1] < self._longest_gap_s * 1e9:
            return replace(self, stamps=(stamp,), late_s=0.0, sigma_s=self.jitter_s)
        stamps = (*self.stamps, stamp)[-TUNING.clock_window :]
        seconds = (np.array(stamps) - stamp) * 1e-9
        period = float(np.median(np.diff(seconds)))
        if len(stamps) < TUNING.clock_least:
            jitter = self.jitter_s or TUNING.clock_unknown * period
            return StampClock(stamps, 0.0, jitter, period, jitter)
        late, jitter, period = _fit_line(seconds, period)
        if jitter > TUNING.clock_most_unsteady * period:
            return StampClock(stamps, 0.0, 0.0, period, 0.0)
        return StampClock(stamps, late, jitter * 2.0 / np.sqrt(len(stamps)), period, jitter)


def _fit_line(seconds: Array, period: float) -> tuple[float, float, float]:
    """Return how far the last of `seconds` (n) lies above a line over whole periods, the line's noise and slope (s)."""
    counts = np.zeros(len(seconds))
    expected = seconds[0]
    for k in range(1, len(seconds)):
        periods = max(1, round((seconds[k] - expected) / period))
        expected += periods * period
        expected += TUNING.clock_gain * (seconds[k] - expected)
        counts[k] = counts[k - 1] + periods
    weight = np.ones(len(seconds))
    for _ in range(2):  # the second time without outliers
        count, second = np.average(counts, weights=weight), np.average(seconds, weights=weight)
        slope = np.sum(weight * (counts - count) * (seconds - second)) / np.sum(weight * (counts - count) ** 2)
        residual = seconds - second - slope * (counts - count)
        sigma = 1.4826 * np.median(np.abs(residual)) + 1e-9
        weight = (np.abs(residual) < TUNING.clock_outlier * sigma).astype(np.float64)
    return float(residual[-1]), float(np.sqrt(np.average(residual**2, weights=weight))), float(slope)
