"""Rates, missing frames and the distance of colour and depth stamps, from the stamps alone."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.evaluation.times import Stamps
from odom.evaluation.trajectory import nearest

_SHORT_QUANTILE, _SHORT_SPREAD = 0.15, 1.6
"""Intervals up to so many times this quantile are one period long: even when half of the frames are missing, a
seventh of the intervals is, and two periods are beyond the spread."""
_PAIR_PERIODS = 0.75
"""Stamps of a pair lie at most so many periods apart; without synchronisation half a period is usual."""
_SLOWEST_HZ = 18.0
"""Lowest frame rate for a camera in the hand: at fewer frames a second fast turns leave too little overlap."""
_MISSING_SHARE = 0.15
"""Largest share of missing frames; a larger limit misses faults."""
_REFUSED_SHARE = 0.6
"""Share of a stream's images with a stamp that does not go on, from which the stamps are the fault: where each image
comes twice it is half."""
_UNMATCHED_SHARE = 0.15
"""Largest share of colour frames without depth that missing frames do not explain."""
_OTHER_CLOCK_S = 1.0
"""Distance of the stamps from which no lack of synchronisation explains it."""


@dataclass(frozen=True)
class Rhythm:
    """How a stream's stamps follow each other.

    `period_s` is that of the sensor (a low quantile of the intervals, so that missing frames do not stretch it),
    `rate_hz` what really came, `jitter_s` the median absolute deviation of whole periods, `missing` the share of
    frames that should have come by the sensor's period and did not, `longest_s` the longest hole.
    """

    rate_hz: float
    period_s: float
    jitter_s: float
    missing: float
    longest_s: float


def rhythm(stamps: Stamps) -> Rhythm | None:
    """Return the rhythm of a stream of increasing stamps (ns), or None for fewer than five."""
    if len(stamps) < 5:
        return None
    intervals = np.diff(stamps) * 1e-9
    short = intervals[intervals <= _SHORT_SPREAD * np.quantile(intervals, _SHORT_QUANTILE)]
    period = float(short.mean())
    steps = np.maximum(np.rint(intervals / period), 1.0)
    jitter = float(np.median(np.abs(intervals / steps - period)))
    duration = float(intervals.sum())
    return Rhythm(
        rate_hz=(len(stamps) - 1) / duration,
        period_s=period,
        jitter_s=jitter,
        missing=float(1.0 - len(intervals) / steps.sum()),
        longest_s=float(intervals.max()),
    )


def judge_rhythm(name: str, stamps: Stamps, refused: Mapping[str, int] | None = None) -> Finding:
    """Judge the rate and the holes of the stream called `name`.

    `stamps` are its different ones; `refused` counts by reason the images whose stamp did not go on from the last.
    """
    found = rhythm(stamps)
    key = f"{name} frames"
    if refused and (found is None or sum(refused.values()) > _REFUSED_SHARE * (sum(refused.values()) + len(stamps))):
        return _stamps_stand_still(key, stamps, refused)
    if found is None:
        return Finding(key, f"{len(stamps)} came", Verdict.BAD, f"no {name} arrives: check the cable, driver and topic")
    value = (
        f"{found.rate_hz:.1f} a second (sensor {1 / found.period_s:.1f}), {found.missing:.0%} missing, "
        f"jitter {1e3 * found.jitter_s:.1f} ms, longest hole {1e3 * found.longest_s:.0f} ms"
    )
    if found.missing > _MISSING_SHARE:
        advice = (
            "frames are lost before they get here: plug the sensor into a USB port of its own, record raw without "
            "compression or to a faster disk, and look for a busy CPU"
        )
        return Finding(key, value, Verdict.BAD, advice)
    advice = (
        "too slow for a camera in the hand: set the sensor to 30 frames a second (a dark room makes some cameras "
        "expose longer: turn the light on); where it gave more, the stamps are in another unit: write them in seconds"
    )
    return Finding.judged(key, value, found.rate_hz < _SLOWEST_HZ, advice)


def _stamps_stand_still(key: str, stamps: Stamps, refused: Mapping[str, int]) -> Finding:
    """Say how most images of a stream are stamped, none of which can be told from the one before by its time."""
    reason, count = max(refused.items(), key=lambda item: item[1])
    if len(stamps) and not stamps.any():
        value = "all that came are stamped 0"
    else:
        value = f"{count} that came have a {reason}: {len(stamps)} different stamps"
    advice = (
        "the stamps do not advance, so no image has a time: let the driver stamp each with the time it was taken (in "
        "ROS header.stamp, in a list of files its first column, in seconds)"
    )
    return Finding(key, value, Verdict.BAD, advice)


def judge_pairs(color: Stamps, depth: Stamps, pairs: int) -> Finding:
    """Judge how many colour frames have depth, and how far apart in time the nearest stamps are.

    Colour frames without depth are no fault of their own where missing frames explain them.
    """
    key = "pairs"
    streams = rhythm(color), rhythm(depth)
    if streams[0] is None or streams[1] is None:
        return Finding(key, "nothing to pair", Verdict.UNKNOWN)
    offsets = (depth[nearest(depth, color)] - color) * 1e-9
    period = max(stream.period_s for stream in streams if stream)
    within = np.abs(offsets) <= _PAIR_PERIODS * period
    value = (
        f"{pairs} of {len(color)} colour frames have depth, stamps "
        f"{1e3 * float(np.median(offsets)):+.1f} ms apart (95 %: {1e3 * float(np.quantile(np.abs(offsets), 0.95)):.0f})"
    )
    missing = max(stream.missing for stream in streams if stream)
    explained = missing > _MISSING_SHARE or 1 - pairs / len(color) <= 2 * missing
    is_bad = (1 - pairs / len(color) > _UNMATCHED_SHARE and not explained) or bool(
        within.mean() < 0.5 * (1.0 - missing)
    )
    apart = float(depth[0] - color[0]) * 1e-9  # of streams that do not overlap, the beginnings belong together
    if abs(float(np.median(offsets))) > _OTHER_CLOCK_S:
        advice = (
            f"colour and depth are of different times or clocks: add {-apart:.3f} s to the stamps of depth, or check "
            "that both lists are of the same recording"
        )
        return Finding(key, value, Verdict.BAD, advice)
    advice = (
        "colour and depth do not belong together: switch on frame synchronisation in the driver, or check that "
        "both are stamped by the same clock"
    )
    return Finding.judged(key, value, is_bad, advice)
