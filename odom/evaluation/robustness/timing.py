"""Degrades time: stamps that jitter or lag, frames that are missing. Images stay as they are."""

import numpy as np

from odom.evaluation.robustness.spoiler import Stream, generator
from odom.frame import RgbdFrame, Stamp

_FARTHEST = 3.0
"""Largest jitter of a stamp, in sigmas."""


def jitter(stream: Stream, stamp: Stamp, sigma_s: float, seed: int) -> Stamp:
    """Return the stamp with normal noise of standard deviation `sigma_s` seconds, cut off at three sigmas."""
    off = float(np.clip(generator(seed, stamp, stream).standard_normal(), -_FARTHEST, _FARTHEST))
    return Stamp(stamp + round(1e9 * sigma_s * off))


def late_depth(stream: Stream, stamp: Stamp, lag_s: float) -> Stamp:
    """Return a depth image's stamp `lag_s` seconds later, a colour image's unchanged: depth is older than stamped."""
    return Stamp(stamp + round(1e9 * lag_s)) if stream is Stream.DEPTH else stamp


def one_in(frame: RgbdFrame, n: int) -> RgbdFrame | None:
    """Return the frame if it is an `n`-th one, else None."""
    return frame if frame.sequence % n == 0 else None
