"""The table of the physical experiment: means over all pairs of clouds, with their 95 % intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from odom.evaluation.physical.judging import NAMES, Outcome
from odom.geometry.arrays import Array

PAPER_MM = {
    "kinect2": {"EM-ICP": 274.0, "WICP": 152.0, "Horn": 246.0, "RF": 0.72, "KF": 1.62},
    "kinect1": {"EM-ICP": 310.0, "WICP": 162.0, "Horn": 302.0, "RF": 1.03, "KF": 2.03},
}
"""The first two rows of the paper's Table 1, in mm: kinect2 is its newer Kinect, kinect1 its older one."""
_RESAMPLES = 2000
"""Resamples of the bootstrap: fewer make the ends of the interval jump in the second digit."""


@dataclass(frozen=True)
class Row:
    """One estimator, on one sensor and front-end, with or without the gate, over all pairs of clouds.

    `rmse_mm` is the mean over those with a pose, `low_mm` to `high_mm` its 95 % interval (bootstrap over the pairs of
    clouds), `median_mm` the median; `lab_mm` and `noisy_mm` are the means of the two other RMSE, `time_ms` the median
    of CPU. `clouds` were tried, `none` gave no pose, `off` one beyond 5 cm or 3 deg. `wrong` is the share of wrong
    pairs, `pairs` their usual number.
    """

    sensor: str
    front_end: str
    is_gated: bool
    estimator: str
    clouds: int
    pairs: float
    wrong: float
    rmse_mm: float
    low_mm: float
    high_mm: float
    median_mm: float
    lab_mm: float
    noisy_mm: float
    time_ms: float
    none: int
    off: int
    paper_mm: float | None = None


def rows(sensor: str, outcomes: Sequence[Outcome], seed: int) -> list[Row]:
    """Return the table of one sensor, a row an estimator, front-ends in the order of the outcomes."""
    front_ends = list(dict.fromkeys(outcome.front_end for outcome in outcomes))
    return [
        _row(sensor, [o for o in outcomes if (o.front_end, o.is_gated, o.estimator) == key], seed)
        for front_end in front_ends
        for is_gated in (False, True)
        for name in NAMES
        for key in [(front_end, is_gated, name)]
    ]


def _row(sensor: str, chosen: list[Outcome], seed: int) -> Row:
    first = chosen[0]
    posed = [o for o in chosen if not o.reason]
    each = np.array([(o.rmse_mm, o.rmse_lab_mm, o.rmse_noisy_mm, o.time_ms) for o in posed]).reshape(-1, 4)
    low, high = interval(each[:, 0], seed)
    found = sum(o.pairs for o in chosen)
    return Row(
        sensor=sensor,
        front_end=first.front_end,
        is_gated=first.is_gated,
        estimator=first.estimator,
        clouds=len(chosen),
        pairs=float(np.median([o.pairs for o in chosen])),
        wrong=sum(o.wrong for o in chosen) / found if found else float("nan"),
        rmse_mm=_mean(each[:, 0]),
        low_mm=low,
        high_mm=high,
        median_mm=float(np.median(each[:, 0])) if len(each) else float("nan"),
        lab_mm=_mean(each[:, 1]),
        noisy_mm=_mean(each[:, 2]),
        time_ms=float(np.median(each[:, 3])) if len(each) else float("nan"),
        none=len(chosen) - len(posed),
        off=sum(o.is_off for o in posed),
        paper_mm=PAPER_MM.get(sensor, {}).get(first.estimator),
    )


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def interval(values: Array, seed: int) -> tuple[float, float]:
    """Return the 95 % interval of the mean of values by the bootstrap (B. Efron, Ann. Stat. 7, 1979)."""
    if len(values) < 2:
        return float("nan"), float("nan")
    rng = np.random.default_rng(seed)
    means = values[rng.integers(0, len(values), (_RESAMPLES, len(values)))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)
