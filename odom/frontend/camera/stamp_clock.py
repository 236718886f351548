"""When a frame was really taken: a camera's own clock is steady, but the host's stamps of its images jitter.

The stamps of a Kinect's images jitter by milliseconds about its steady period; between two frames that is a tenth of
the motion. A straight line through the last stamps gives the steady time of each. Whatever depends on velocity is
computed in steady time, and only what is published is carried to the stamp itself.
"""

import math
from dataclasses import dataclass, replace
from typing import NewType

import numpy as np

from odom.frame import Stamp
from odom.frontend.camera.tuning import TUNING
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

SteadyStamp = NewType("SteadyStamp", int)
"""Nanoseconds since the Unix epoch by the camera's steady clock, in contrast to a `Stamp` as it was sent."""


def later(stamp: SteadyStamp, by_s: float) -> SteadyStamp:
    """Return the steady time `by_s` seconds after `stamp`."""
    return SteadyStamp(stamp + round(by_s * 1e9))


def is_within(within_s: float, then: SteadyStamp | None, now: SteadyStamp | None) -> bool:
    """Return whether `then` was less than `within_s` away from `now`; False where either is None: never."""
    return then is not None and now is not None and abs(now - then) * 1e-9 < within_s


@dataclass(frozen=True)
class StampClock:
    """A stream's clock after its newest stamp: `stamps` (ns) are the last ones without a gap.

    The newest stamp is `late_s` later than its steady time, known with one sigma of `sigma_s`; `period_s` is the
    stream's period and `jitter_s` one sigma of a single stamp, 0 where unknown. Where stamps are not multiples of a
    period apart they are used as they are; so they are where the rate changes, as it does with exposure in dim light.
    After a stamp that is off by more than a host's delay and its jitter the clock begins anew: in a stream that was
    thinned out, a missing frame shifts the later ones by a part of a period.
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
        """The longest time to the next stamp that counts as no gap; after a gap, the longest period of any stream."""
        if len(self.stamps) < 2:
            return TUNING.clock_slowest_s
        return max(TUNING.clock_longest_gap_s, TUNING.clock_longest_gap_periods * self.period_s)

    def after(self, stamp: Stamp) -> "StampClock":
        """Return the clock after one more stamp; steady time advances wherever stamps do."""
        clock = self._fitted(stamp)
        if not self.stamps or stamp <= self.stamps[-1] or clock.steady > self.steady:
            return clock
        sigma_s = math.hypot(clock.late_s - self.late_s, self.sigma_s, clock.sigma_s)
        return replace(clock, late_s=self.late_s, sigma_s=sigma_s)

    def _fitted(self, stamp: Stamp) -> "StampClock":
        """Return the clock with the line through the last stamps up to `stamp`."""
        if not self.stamps or not 0 < stamp - self.stamps[-1] < self._longest_gap_s * 1e9:
            return self._begun_anew(stamp)
        stamps = (*self.stamps, stamp)[-TUNING.clock_window :]
        seconds = (np.array(stamps) - stamp) * 1e-9
        steps = np.sort(seconds[1:] - seconds[:-1])
        period = float(0.5 * (steps[(len(steps) - 1) // 2] + steps[len(steps) // 2]))
        if len(stamps) < TUNING.clock_least:
            jitter = self.jitter_s or TUNING.clock_unknown * period
            return StampClock(stamps, 0.0, jitter, period, jitter)
        every, periods = np.arange(float(len(seconds))), _periods(seconds, period, TUNING.clock_gain)
        is_whole = _unevenness(every, seconds) <= _unevenness(periods, seconds)
        shorter, longer = float(steps[len(steps) // 4]), float(steps[3 * len(steps) // 4])
        if longer > TUNING.clock_uneven * shorter:  # many frames are missing, or stamps jitter a lot
            short = _periods(seconds, shorter, TUNING.clock_gain)
            if _unevenness(short, seconds) < TUNING.clock_even**2:
                is_whole, periods = False, short
        is_gapless = steps[-1] < 1.5 * period  # a missing frame would make a step of two periods
        whiteness, jitter = _whiteness(every if is_whole or is_gapless else periods, seconds)
        if whiteness < TUNING.clock_least_white:
            return StampClock(stamps, 0.0, jitter, period, jitter)
        most_unsteady = TUNING.clock_most_unsteady_whole if is_whole else TUNING.clock_most_unsteady
        late, jitter, period = _fit_line(every if is_whole else periods, seconds, TUNING.clock_outlier)
        if jitter > most_unsteady * period:
            return StampClock(stamps, 0.0, 0.0, period, 0.0)
        if abs(late) > max(TUNING.clock_most_late_s, TUNING.clock_outlier * jitter):
            return self._begun_anew(stamp)
        return StampClock(stamps, late, jitter * 2.0 / np.sqrt(len(stamps)), period, jitter)

    def _begun_anew(self, stamp: Stamp) -> "StampClock":
        """Return the clock of a stream that begins, or begins anew, with `stamp`."""
        return replace(self, stamps=(stamp,), late_s=0.0, sigma_s=self.jitter_s)


@compiled
def _periods(seconds: Array, period: float, gain: float) -> Array:
    """Return how many whole periods each of `seconds` (n) comes after the first, where frames may be missing.

    `gain` is the share of a stamp's error taken over to the next expected stamp.
    """
    counts = np.zeros(len(seconds))
    expected = seconds[0]
    for k in range(1, len(seconds)):
        periods = max(1, round((seconds[k] - expected) / period))
        expected += periods * period
        expected += gain * (seconds[k] - expected)
        counts[k] = counts[k - 1] + periods
    return counts


@compiled
def _unevenness(counts: Array, seconds: Array) -> float:
    """Return the mean square distance of `seconds` (n) from a line over the `counts` of periods, in periods^2."""
    count, second = counts.mean(), seconds.mean()
    slope = ((counts - count) * (seconds - second)).sum() / ((counts - count) ** 2).sum()
    return float((((seconds - second) / slope - (counts - count)) ** 2).mean())


@compiled
def _whiteness(counts: Array, seconds: Array) -> tuple[float, float]:
    """Return how white the residuals of `seconds` (n) from a line over the `counts` are, and their jitter (s).

    Half the mean square of their steps over their variance (J. von Neumann 1941) is near 1 where stamps jitter by
    chance and near 0 where the line bends. The jitter is that of second differences, which no slow bend adds to.
    """
    count, second = counts.mean(), seconds.mean()
    slope = ((counts - count) * (seconds - second)).sum() / ((counts - count) ** 2).sum()
    residual = seconds - second - slope * (counts - count)
    steps = residual[1:] - residual[:-1]
    turns = steps[1:] - steps[:-1]
    rounding = 1e-18
    whiteness = (0.5 * (steps**2).mean() + rounding) / ((residual**2).mean() + rounding)
    return whiteness, np.sqrt((turns**2).mean() / 6.0)


@compiled
def _fit_line(counts: Array, seconds: Array, outlier: float) -> tuple[float, float, float]:
    """Return how far the last of `seconds` (n) lies above a line over the `counts`, the line's noise and slope (s).

    Stamps more than `outlier` sigmas off a first line are left out of the second one.
    """
    n = len(seconds)
    weight, residual, in_order = np.ones(n), np.zeros(n), np.zeros(n)
    slope = variance = 0.0
    for _ in range(2):
        total = weight.sum()
        count, second = (weight * counts).sum() / total, (weight * seconds).sum() / total
        slope = (weight * (counts - count) * (seconds - second)).sum() / (weight * (counts - count) ** 2).sum()
        residual = seconds - second - slope * (counts - count)
        for k in range(n):
            i = k
            while i > 0 and in_order[i - 1] > abs(residual[k]):
                in_order[i] = in_order[i - 1]
                i -= 1
            in_order[i] = abs(residual[k])
        sigma = 1.4826 * 0.5 * (in_order[(n - 1) // 2] + in_order[n // 2]) + 1e-9
        for k in range(n):
            weight[k] = 1.0 if abs(residual[k]) < outlier * sigma else 0.0
        variance = (weight * residual**2).sum() / weight.sum()
    return residual[n - 1], np.sqrt(variance), slope
