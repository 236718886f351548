"""The paper's Table 1 reproduced: five estimators on the same clouds, beside the bound and the paper's figures."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from odom.evaluation.paper.bound import bound_rmse
from odom.evaluation.paper.scenarios import MAGNITUDES_M, STRESS, Noise, Sample, cloud, nearby, stressed, with_outliers
from odom.geometry.se3 import apply, inverse, log
from odom.registration import Estimator, Pairs, Prior, Registration, em_icp, horn, kalman, register, robust, wicp

ESTIMATORS: dict[str, Estimator] = {"EM-ICP": em_icp, "WICP": wicp, "Horn": horn, "RF": robust, "KF": kalman}
"""The paper's five, in the order of its Table 1."""
PAPER_MM = {
    "small": {"EM-ICP": 298.0, "WICP": 193.0, "Horn": 285.0, "RF": 0.55, "KF": 1.52},
    "average": {"EM-ICP": 323.0, "WICP": 235.0, "Horn": 315.0, "RF": 0.91, "KF": 1.78},
    "large": {"EM-ICP": 332.0, "WICP": 260.0, "Horn": 343.0, "RF": 0.96, "KF": 2.10},
}
"""What Table 1 prints, in millimetres."""
OUTLIER_RATIOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
"""Shares of wrong pairs."""
CONFIDENTLY_WRONG = 25.0
"""NEES above which a result counts as confidently wrong: an error beyond five of its own standard deviations."""


@dataclass(frozen=True)
class Row:
    """One estimator over all clouds of a scenario; means over the clouds with a result, but the median of the time.

    `rmse_mm` is against noise-free targets, `rmse_noisy_mm` against the measured ones; `bound_mm` the mean Cramer-Rao
    bound and `rms_ratio` the root mean square of RMSE / bound; `confidently_wrong` counts errors beyond five sigma of
    the result's own covariance; `paper_mm` is the paper's figure, None where it has none.
    """

    group: str
    scenario: str
    estimator: str
    clouds: int
    rmse_mm: float
    bound_mm: float
    rms_ratio: float
    rmse_noisy_mm: float
    rotation_deg: float
    translation_mm: float
    nees: float
    time_ms: float
    degenerate: int
    confidently_wrong: int
    paper_mm: float | None = None


def _errors(sample: Sample, result: Registration) -> tuple[float, float, float, float, float]:
    """Return RMSE to clean and to noisy targets (m), rotation (rad), translation (m) and NEES of one result."""
    right = ~sample.wrong
    q, p = sample.true.points_source, sample.true.points_target
    T = result.T_target_source
    clean = apply(T, q) - p
    noisy = (apply(T, sample.measured.points_source) - sample.measured.points_target)[right]
    xi = log(inverse(T) @ sample.T)
    nees = float(xi @ np.linalg.solve(result.covariance, xi))
    rmse = float(np.sqrt((clean**2).sum(axis=1).mean()))
    rmse_noisy = float(np.sqrt((noisy**2).sum(axis=1).mean())) if right.any() else float("nan")
    turn, shift = float(np.linalg.norm(xi[3:])), float(np.linalg.norm(T[:3, 3] - sample.T[:3, 3]))
    return rmse, rmse_noisy, turn, shift, nees


def rows(
    group: str,
    scenario: str,
    samples: Iterable[Sample],
    estimators: dict[str, Estimator],
    paper_mm: dict[str, float] | None = None,
) -> list[Row]:
    """Return one row per estimator: all see the same samples."""
    errors: dict[str, list[tuple[float, ...]]] = {name: [] for name in estimators}
    ratios: dict[str, list[float]] = {name: [] for name in estimators}
    times: dict[str, list[float]] = {name: [] for name in estimators}
    bounds: list[float] = []
    for sample in samples:
        right = ~sample.wrong if not sample.wrong.all() else sample.wrong
        bounds.append(bound_rmse(sample.T, sample.true[right]))
        for name, estimator in estimators.items():
            begun = time.perf_counter()
            result = estimator(sample.measured)
            times[name].append(time.perf_counter() - begun)
            if result.ok:
                errors[name].append(_errors(sample, result))
                ratios[name].append(errors[name][-1][0] / bounds[-1])
    found = []
    for name in estimators:
        each = np.array(errors[name]).reshape(-1, 5)
        rmse, rmse_noisy, turn, shift, nees = each.mean(axis=0).tolist() if len(each) else [float("nan")] * 5
        row = Row(
            group=group,
            scenario=scenario,
            estimator=name,
            clouds=len(bounds),
            rmse_mm=1e3 * rmse,
            bound_mm=1e3 * float(np.mean(bounds)),
            rms_ratio=float(np.sqrt(np.mean(np.square(ratios[name])))) if ratios[name] else float("nan"),
            rmse_noisy_mm=1e3 * rmse_noisy,
            rotation_deg=float(np.degrees(turn)),
            translation_mm=1e3 * shift,
            nees=nees,
            time_ms=1e3 * float(np.median(times[name])),
            degenerate=len(bounds) - len(each),
            confidently_wrong=int((each[:, 4] > CONFIDENTLY_WRONG).sum()),
            paper_mm=None if paper_mm is None else paper_mm.get(name),
        )
        found.append(row)
    return found


def paper_scenarios(clouds: int) -> Iterator[list[Row]]:
    """Yield the paper's synthetic scenarios: three magnitudes, each noise model, on the target or both sides."""
    for magnitude in MAGNITUDES_M:
        for noise in (Noise.AXIS, Noise.POINT, Noise.RAY):
            for both in (False, True):
                name = f"{magnitude}, {noise.value}, {'both clouds' if both else 'target'}"
                samples = (cloud(seed, noise, magnitude, both) for seed in range(clouds))
                yield rows("paper", name, samples, ESTIMATORS, PAPER_MM[magnitude])
    for both in (False, True):
        name = f"{Noise.KINECT.value}, {'both clouds' if both else 'target'}"
        yield rows("paper", name, (cloud(seed, Noise.KINECT, "small", both) for seed in range(clouds)), ESTIMATORS)


def stress_cases(clouds: int) -> Iterator[list[Row]]:
    """Yield the cases in which the noise is stated wrongly."""
    for case in STRESS:
        yield rows("told wrongly", case, (stressed(seed, case) for seed in range(clouds)), ESTIMATORS)


def without_correspondences(clouds: int) -> Iterator[list[Row]]:
    """Yield WICP and EM-ICP as they are meant to be used: on unordered clouds that are close together."""
    estimators: dict[str, Estimator] = {"EM-ICP": partial(em_icp, matched=False), "WICP": partial(wicp, matched=False)}
    yield rows("no correspondences", "within 3 cm, 1 deg", (nearby(seed) for seed in range(clouds)), estimators)


def outlier_ratios(clouds: int) -> Iterator[list[Row]]:
    """Yield the estimators with a share of wrong pairs: RF behind the gate, and the five without a gate.

    "RF, told which" is given the right pairs only, as a perfect gate would leave them.
    """

    def told_which(samples: list[Sample]) -> Estimator:
        pending = iter(samples)

        def estimate(pairs: Pairs, prior: Prior | None = None) -> Registration:
            return robust(pairs[~next(pending).wrong], prior)

        return estimate

    for ratio in OUTLIER_RATIOS:
        samples = [with_outliers(seed, ratio) for seed in range(clouds)]
        estimators: dict[str, Estimator] = {"gate + RF": register, "RF, told which": told_which(samples)}
        yield rows("wrong pairs", f"{100 * ratio:.0f} % wrong", samples, estimators | ESTIMATORS)
