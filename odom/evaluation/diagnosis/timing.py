"""Rates, missing frames and the distance of colour and depth stamps, from the stamps alone."""

from dataclasses import dataclass

import numpy as np

from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.evaluation.trajectory import Stamps

_SLOWEST_HZ = 18.0
_MISSING_SHARE = 0.15
_UNMATCHED_SHARE = 0.15


@dataclass(frozen=True)
class Rhythm:
    """How a stream's stamps follow each other.

    `period_s` is that of the sensor (a low quantile of the intervals, so that missing frames do not stretch it),
    `rate_hz` what really came, `jitter_s` the median absolute deviation of whole periods, `missing` the share of
    frames that the sensor's period lets expect and that are not there, `longest_s` the longest hole.
    """

    count: int
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
    short = intervals[intervals <= 1.6 * np.quantile(intervals, 0.15)]
    period = float(short.mean())
    steps = np.maximum(np.rint(intervals / period), 1.0)
    jitter = float(np.median(np.abs(intervals / steps - period)))
    duration = float(intervals.sum())
    return Rhythm(
        count=len(stamps),
        rate_hz=(len(stamps) - 1) / duration,
        period_s=period,
        jitter_s=jitter,
        missing=float(1.0 - len(intervals) / steps.sum()),
        longest_s=float(intervals.max()),
    )


def judge_rhythm(name: str, stamps: Stamps) -> Finding:
    """Judge the rate and the holes of the stream called `name`."""
    found = rhythm(stamps)
    key = f"{name} frames"
    if found is None:
        return Finding(key, f"{len(stamps)} came", Verdict.BAD, f"no {name} arrives: check the cable, driver and topic")
    value = (
        f"{found.rate_hz:.1f} a second (sensor {1 / found.period_s:.1f}), {found.missing:.0%} missing, "
        f"jitter {1e3 * found.jitter_s:.1f} ms, longest hole {1e3 * found.longest_s:.0f} ms"
    )
    if found.missing > _MISSING_SHARE:
        return Finding(
            key, value, Verdict.BAD,
            "frames are lost before they get here: plug the sensor into a USB port of its own, record raw without "
            "compression or to a faster disk, and look for a busy CPU",
        )  # fmt: skip
    if found.rate_hz < _SLOWEST_HZ:
        return Finding(
            key, value, Verdict.BAD,
            "too slow for a camera in the hand: set the sensor to 30 frames a second (a dark room makes some "
            "cameras expose longer: turn the light on)",
        )  # fmt: skip
    return Finding(key, value, Verdict.GOOD)


def judge_pairs(color: Stamps, depth: Stamps, pairs: int) -> Finding:
    """Judge how near in time the nearest depth stamps are, where neither stream has a hole."""
    key = "pairs"
    streams = rhythm(color), rhythm(depth)
    if streams[0] is None or streams[1] is None:
        return Finding(key, "nothing to pair", Verdict.UNKNOWN)
    offsets = nearest_offsets(color, depth) * 1e-9
    period = max(stream.period_s for stream in streams if stream)
    within = np.abs(offsets) <= 0.75 * period
    value = (
        f"{pairs} of {len(color)} colour frames have depth, stamps "
        f"{1e3 * float(np.median(offsets)):+.1f} ms apart (95 %: {1e3 * float(np.quantile(np.abs(offsets), 0.95)):.0f})"
    )
    missing = max(stream.missing for stream in streams if stream)
    explained = missing > _MISSING_SHARE or 1 - pairs / len(color) <= 2 * missing
    if (1 - pairs / len(color) > _UNMATCHED_SHARE and not explained) or within.mean() < 0.5:
        return Finding(
            key, value, Verdict.BAD,
            "colour and depth do not belong together: switch on frame synchronisation in the driver, or check that "
            "both are stamped by the same clock",
        )  # fmt: skip
    return Finding(key, value, Verdict.GOOD)


def nearest_offsets(color: Stamps, depth: Stamps) -> Stamps:
    """Return, for each colour stamp, the nearest depth stamp minus it (ns)."""
    right = np.clip(np.searchsorted(depth, color), 1, len(depth) - 1)
    before, after = depth[right - 1] - color, depth[right] - color
    return np.where(np.abs(before) <= np.abs(after), before, after)
