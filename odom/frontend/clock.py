"""When a frame was really taken: a camera's own clock is steady, the stamps that a host gives its images are not.

The stamps of a Kinect's images jitter by milliseconds about its steady period: by a tenth of the motion between two. A
line through the last stamps tells the steady time of each; whatever depends on velocity is reckoned in that time, and
only what is published is carried to the stamp itself.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.frame import Stamp

Array = NDArray[np.float64]

_WINDOW, _LEAST = 30, 6
_LONGEST_GAP_S = 0.5
_GAIN = 0.2
_MOST_UNSTEADY = 0.25
_OUTLYING = 3.0
_UNKNOWN = 0.05
"""One sigma of a stamp before its stream has shown more, as a share of the period."""


@dataclass(frozen=True)
class Clock:
    """A stream's clock after its newest stamp: `stamps` (ns) are the last ones without a gap.

    `late_s` is by how much the newest is later than its steady time, `sigma_s` one sigma of that; `period_s` is the
    stream's and `jitter_s` one sigma of a single stamp, 0 where unknown. Stamps that are no multiples of a period apart
    are taken for true.
    """

    stamps: tuple[Stamp, ...] = ()
    late_s: float = 0.0
    sigma_s: float = 0.0
    period_s: float = 0.0
    jitter_s: float = 0.0

    @property
    def steady(self) -> Stamp:
        """The steady time of the newest stamp."""
        return Stamp(self.stamps[-1] - round(self.late_s * 1e9))

    def after(self, stamp: Stamp) -> "Clock":
        """Return the clock after one more stamp."""
        if not self.stamps or not 0 < stamp - self.stamps[-1] < _LONGEST_GAP_S * 1e9:
            return replace(self, stamps=(stamp,), late_s=0.0, sigma_s=self.jitter_s)
        stamps = (*self.stamps, stamp)[-_WINDOW:]
        seconds = (np.array(stamps) - stamp) * 1e-9
        period = float(np.median(np.diff(seconds)))
        if len(stamps) < _LEAST:
            jitter = self.jitter_s or _UNKNOWN * period
            return Clock(stamps, 0.0, jitter, period, jitter)
        late, jitter, period = _line(seconds, period)
        if jitter > _MOST_UNSTEADY * period:
            return Clock(stamps, 0.0, 0.0, period, 0.0)
        return Clock(stamps, late, jitter * 2.0 / np.sqrt(len(stamps)), period, jitter)


def _line(seconds: Array, period: float) -> tuple[float, float, float]:
    """Return by how much the last of `seconds` (n) is above a line over whole periods, its noise, and its slope."""
    counts = np.zeros(len(seconds))
    expected = seconds[0]
    for k in range(1, len(seconds)):
        periods = max(1, round((seconds[k] - expected) / period))
        expected += periods * period
        expected += _GAIN * (seconds[k] - expected)
        counts[k] = counts[k - 1] + periods
    weight = np.ones(len(seconds))
    for _ in range(2):
        count, second = np.average(counts, weights=weight), np.average(seconds, weights=weight)
        slope = np.sum(weight * (counts - count) * (seconds - second)) / np.sum(weight * (counts - count) ** 2)
        rest = seconds - second - slope * (counts - count)
        usual = 1.4826 * np.median(np.abs(rest)) + 1e-9
        weight = (np.abs(rest) < _OUTLYING * usual).astype(np.float64)
    return float(rest[-1]), float(np.sqrt(np.average(rest**2, weights=weight))), float(slope)
