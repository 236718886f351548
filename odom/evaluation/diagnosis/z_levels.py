"""The paper's Z-levels, read from what a depth stream shows, beside the depth noise that the odometry has learnt of it.

Depth comes in steps; the paper takes a point's depth to be uncertain by the distance of the third step to either side
(eq. 17), and makes the point's covariance of that (eqs. 18-21).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.evaluation.diagnosis.depth import sampled_depths
from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.frontend.camera.noise_monitor import FeatureNoise
from odom.geometry.arrays import Array
from odom.registration.noise_models import ZLevels

_OCCURS = 0.2
"""A value is a level when it is counted so many times as often as the mean around it: stray values are rarer."""
_AROUND = 0.05
"""Half the width of the neighbourhood, as a share of depth."""
_DEPTHS = (0.1, 0.5, 0.9)
"""Quantiles of the stream's depths at which both sigmas are printed."""


def shown_levels(depths_mm: Sequence[NDArray[np.uint16]]) -> Array:
    """Return the depths (m, increasing) that occur in the images; stray values are left out."""
    counts = np.zeros(1 << 16, dtype=np.int64)
    for depth_mm in depths_mm:
        counts += np.bincount(depth_mm.ravel(), minlength=len(counts))
    counts[0] = 0
    counts = np.trim_zeros(counts, "b")
    values = np.arange(len(counts))
    low = np.floor(values * (1.0 - _AROUND)).astype(np.int64)
    high = np.minimum(np.ceil(values * (1.0 + _AROUND)).astype(np.int64) + 1, len(counts))
    total = np.concatenate([[0], np.cumsum(counts)])
    mean = (total[high] - total[low]) / (high - low)
    return np.asarray(values[(counts > 0) & (counts > _OCCURS * mean)] * 1e-3)


def judge_levels(depths_mm: Sequence[NDArray[np.uint16]], noise: FeatureNoise) -> Finding:
    """Give sigma of the depth by the stream's own Z-levels (eq. 17), and by the noise model that the odometry uses."""
    key = "Z-levels"
    levels_m = shown_levels(depths_mm)
    try:
        model = ZLevels(levels_m)
    except InputError:
        return Finding(key, f"only {len(levels_m)} depths occur", Verdict.UNKNOWN, "look at surfaces at several depths")
    z = np.quantile(sampled_depths(depths_mm) * 1e-3, _DEPTHS)
    by_levels = model.sigmas(z)[1]
    knots, sigma = noise.inverse_depth_sigma
    in_use = z**2 * np.interp(1.0 / z, knots, sigma)
    words = ", ".join(
        f"{1e3 * a:.1f} mm at {depth:.1f} m (noise in use {1e3 * b:.1f})"
        for depth, a, b in zip(z, by_levels, in_use, strict=True)
    )
    return Finding(key, f"{len(levels_m)} of them, sigma {words}", Verdict.GOOD)
