"""Compares two measurements of the cost of frames, frame by frame: the change, and its confidence interval."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

BLOCK_FRAMES = 15
"""Frames of one block of the bootstrap: what neighbouring frames cost is alike, so they are drawn together. Half a
second at 30 Hz, longer than a key frame's work lasts. Half of it: confidence a little too good; twice: fewer blocks."""

FEWEST_BLOCKS = 4
"""Fewer blocks say nothing about confidence."""

_DRAWS = 2000
"""Draws of the bootstrap: the interval's ends are known to some hundredths of its width."""
_CONFIDENCE = 0.95
"""Share of such measurements whose interval holds the true ratio."""


@dataclass(frozen=True)
class CostChange:
    """Cost of one stage before and now, over the same frames.

    `before_ms`, `now_ms` are medians a frame. `ratio` is the sum now over the sum before; with 95 % confidence it lies
    between `low` and `high` as far as these frames can tell; not a number where hardly a frame passed the stage before.
    """

    stage: str
    before_ms: float
    now_ms: float
    ratio: float
    low: float
    high: float


def cost_change(stage: str, before_ms: ArrayLike, now_ms: ArrayLike) -> CostChange:
    """Compare the milliseconds of a stage, frame k before with frame k now.

    The interval is a percentile bootstrap of the paired ratio over blocks of `BLOCK_FRAMES` frames (Kuensch, "The
    jackknife and the bootstrap for general stationary observations", Annals of Statistics 17, 1989), seeded. Raises
    ValueError when the two are not of the same length, or shorter than `FEWEST_BLOCKS` blocks.
    """
    before, now = np.asarray(before_ms, dtype=float), np.asarray(now_ms, dtype=float)
    if before.shape != now.shape or before.ndim != 1:
        raise ValueError(f"costs of the same frames must be given: {before.shape} and {now.shape}")
    blocks = len(before) // BLOCK_FRAMES
    if blocks < FEWEST_BLOCKS:
        raise ValueError(f"{len(before)} frames are too few to compare: {FEWEST_BLOCKS * BLOCK_FRAMES} are needed")
    medians = float(np.median(before)), float(np.median(now))
    sums = _block_sums(before, blocks), _block_sums(now, blocks)
    if np.count_nonzero(sums[0]) < FEWEST_BLOCKS:
        return CostChange(stage, *medians, np.nan, np.nan, np.nan)
    drawn = np.random.default_rng(0).integers(blocks, size=(_DRAWS, blocks))
    totals = [s[drawn].sum(axis=1) for s in sums]
    ratios = totals[1][totals[0] > 0.0] / totals[0][totals[0] > 0.0]
    low, high = np.quantile(ratios, (0.5 - _CONFIDENCE / 2, 0.5 + _CONFIDENCE / 2))
    return CostChange(stage, *medians, float(sums[1].sum() / sums[0].sum()), float(low), float(high))


def _block_sums(costs_ms: NDArray[np.float64], blocks: int) -> NDArray[np.float64]:
    edges = np.linspace(0, len(costs_ms), blocks, endpoint=False).astype(int)
    return np.add.reduceat(costs_ms, edges)
