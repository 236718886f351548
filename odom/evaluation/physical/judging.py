"""The errors of the five estimators on one set of pairs, with and without the gate, against truth."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from odom.errors import InputError
from odom.evaluation.paper.benchmark import ESTIMATORS
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.registration import Pairs, Registration, register
from odom.registration.gate import BOUND

WRONG_M = 0.05
"""A pair whose points truth puts this far apart, and beyond the .999 bound of their own noise, does not belong
together."""
OFF_M, OFF_RAD = 0.05, float(np.radians(3.0))
"""A pose that is off by more than one of these is useless even as a first guess."""
NAMES = tuple(ESTIMATORS)
"""The five, in the order of the paper's table."""


@dataclass(frozen=True)
class Outcome:
    """One estimator's answer to the pairs of two looks.

    `rmse_mm` is that of the moved source points (of pairs that belong together) against where truth moves them,
    `rmse_lab_mm` the same against the motion capture's truth, `rmse_noisy_mm` the paper's own: against the measured
    targets of all pairs that it was given. All are NaN where there is no pose; `reason` then says why. `pairs` and
    `wrong` count the pairs found and those that do not belong together; `is_off` says whether the pose is of no use.
    """

    number: int
    front_end: str
    is_gated: bool
    estimator: str
    pairs: int
    wrong: int
    time_ms: float
    rmse_mm: float = float("nan")
    rmse_lab_mm: float = float("nan")
    rmse_noisy_mm: float = float("nan")
    error_mm: float = float("nan")
    error_deg: float = float("nan")
    is_off: bool = False
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Truth:
    """The true motions of two looks (4 x 4, T_target_source): the best known, and by motion capture (None: a gap)."""

    T: Array
    T_lab: Array | None = None


def wrong_pairs(pairs: Pairs, T: Array) -> Mask:
    """Return which pairs (n) do not belong together, by the true motion T."""
    residual = pairs.points_target - se3.apply(T, pairs.points_source)
    S = np.zeros((len(pairs), 3, 3))
    if pairs.covariances_target is not None:
        S += pairs.covariances_target
    if pairs.covariances_source is not None:
        S += T[:3, :3] @ pairs.covariances_source @ T[:3, :3].T
    chi2 = np.einsum("ni,ni->n", residual, np.linalg.solve(S, residual[:, :, None])[:, :, 0])
    return np.asarray((np.linalg.norm(residual, axis=1) > WRONG_M) & (chi2 > BOUND))


def judge(pairs: Pairs, truth: Truth, number: int, front_end: str) -> list[Outcome]:
    """Return the outcomes of all five estimators on these pairs, without the gate and behind it."""
    try:
        wrong = wrong_pairs(pairs, truth.T)
        gated, _ = _timed(lambda: register(pairs))
    except InputError as error:
        return [
            Outcome(number, front_end, is_gated, name, len(pairs), 0, float("nan"), reason=str(error))
            for is_gated in (False, True)
            for name in NAMES
        ]
    outcomes = []
    for is_gated in (False, True):
        given = pairs[gated.inliers] if is_gated and gated.ok else pairs
        for name, estimator in ESTIMATORS.items():
            outcome = Outcome(number, front_end, is_gated, name, len(pairs), int(wrong.sum()), float("nan"))
            if is_gated and not gated.ok:
                outcomes.append(replace(outcome, reason=gated.reason))
                continue
            found, took_ms = _timed(partial(estimator, given))
            if not found.ok:
                outcomes.append(replace(outcome, reason=found.reason))
                continue
            right = pairs.points_source[~wrong] if not wrong.all() else pairs.points_source
            outcomes.append(_measured(outcome, found, took_ms, right, given, truth))
    return outcomes


def _timed(work: Callable[[], Registration]) -> tuple[Registration, float]:
    begun = time.thread_time()
    found = work()
    return found, 1e3 * (time.thread_time() - begun)


def _measured(
    outcome: Outcome, found: Registration, took_ms: float, points: Array, given: Pairs, truth: Truth
) -> Outcome:
    T = found.T_target_source
    xi = se3.log(se3.inverse(T) @ truth.T)
    shift_m, turn = float(np.linalg.norm(xi[:3])), float(np.linalg.norm(xi[3:]))
    return replace(
        outcome,
        time_ms=took_ms,
        rmse_mm=rmse_mm(T, points, se3.apply(truth.T, points)),
        rmse_lab_mm=float("nan") if truth.T_lab is None else rmse_mm(T, points, se3.apply(truth.T_lab, points)),
        rmse_noisy_mm=rmse_mm(T, given.points_source, given.points_target),
        error_mm=1e3 * shift_m,
        error_deg=float(np.degrees(turn)),
        is_off=shift_m > OFF_M or turn > OFF_RAD,
    )


def rmse_mm(T: Array, source: Array, target: Array) -> float:
    """Return the paper's RMSE of moved source points against targets, in mm."""
    return 1e3 * float(np.sqrt(((se3.apply(T, source) - target) ** 2).sum(axis=1).mean()))
