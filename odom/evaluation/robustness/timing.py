"""Time spoilt: stamps that jitter or lag, frames that are missing. Images stay as they are."""

import numpy as np

from odom.evaluation.robustness.spoiler import Stream, chance
from odom.frame import RgbdFrame, Stamp

_FARTHEST = 3.0
"""No stamp jitters by more sigmas."""


def jitter(stream: Stream, stamp: Stamp, sigma_s: float, seed: int) -> Stamp:
    """Return a stamp that is off by chance, by `sigma_s` seconds (standard deviation; three at most)."""
    off = float(np.clip(chance(seed, stamp, stream).standard_normal(), -_FARTHEST, _FARTHEST))
    return Stamp(stamp + round(1e9 * sigma_s * off))


def late_depth(stream: Stream, stamp: Stamp, lag_s: float) -> Stamp:
    """Return a depth image's stamp late by `lag_s` seconds, a colour image's as it is: depth is older than it says."""
    return Stamp(stamp + round(1e9 * lag_s)) if stream is Stream.DEPTH else stamp


def one_in(frame: RgbdFrame, n: int) -> RgbdFrame | None:
    """Return every `n`-th frame, None for the others."""
    return frame if frame.sequence % n == 0 else None
