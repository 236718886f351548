"""From pairs to a result: checked arrays, the recursion's solution, the judged registration."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.registration.gate import bad_covariance
from odom.registration.kernels import precisions
from odom.registration.motion import horn
from odom.registration.pairs import Array, Pairs, Prior, Registration, Verdict, degenerate
from odom.registration.projection import assess
from odom.registration.recursion import recurse, unusable

_NO_COVARIANCES = np.empty((0, 3, 3))
_NO_PRIOR = np.empty((0, 0))
_IDENTITY = np.eye(4)
_MAX_ROTATION_SIGMA = 0.2
_MIN_SCATTER = 9.0


class Arrays(NamedTuple):
    """The checked arrays of n pairs, as the compiled loops take them: missing covariances have length 0."""

    q: Array
    p: Array
    Sq: Array
    Sp: Array
    weights: Array


def checked(pairs: Pairs) -> Arrays:
    """Return the arrays of `pairs`; raises InputError unless all is finite and there are covariances."""
    if pairs.covariances_source is None and pairs.covariances_target is None:
        raise InputError("the pairs have no covariances: give those of a noise model for at least one side")
    weights = np.ones(len(pairs)) if pairs.weights is None else pairs.weights
    match unusable(pairs.points_source, pairs.points_target, weights):
        case 1:
            raise InputError("points are not all finite: leave out pairs without a measurement")
        case 2:
            raise InputError("weights must be finite and not negative")
    Sq = _NO_COVARIANCES if pairs.covariances_source is None else pairs.covariances_source
    Sp = _NO_COVARIANCES if pairs.covariances_target is None else pairs.covariances_target
    return Arrays(pairs.points_source, pairs.points_target, Sq, Sp, weights)


class Solution(NamedTuple):
    """What the recursion knows after all pairs: the motion T, its information H, Y and y of vec[R | t].

    `W`, `weights` and `chi2` belong to the pairs, `sums` (6) are those of `statistics`; `determined` is False where
    the pairs do not fix the motion.
    """

    T: Array
    H: Array
    Y: Array
    y: Array
    W: Array
    weights: Array
    chi2: Array
    sums: Array
    determined: bool


def start(arrays: Arrays, weights: Array) -> Array:
    """Return where S_k is linearised first: Horn's weighted motion (4 x 4); the identity if it needs no R."""
    T = _IDENTITY.copy()
    if len(arrays.Sq) == 0:
        return T
    W = np.empty((len(arrays.q), 8))
    bad = precisions(arrays.Sq, arrays.Sp, T, 0.0, W)
    if bad >= 0:
        raise bad_covariance(bad)
    horn(arrays.q, arrays.p, W, weights, T)
    return T


def solve(
    arrays: Arrays,
    prior: Prior | None,
    T: Array,
    weights: Array,
    bound: float = np.inf,
    alpha: float = 0.0,
) -> Solution:
    """Return the recursion's solution, S_k linearised at `T` first; pairs within `bound` join or leave on the way.

    `alpha` > 0 takes the norm-bounded form of the source's noise. Raises InputError for a covariance that is not
    positive.
    """
    n = len(arrays.q)
    motion, weights = T.copy(), weights.copy()
    W, chi2, sums = np.empty((n, 8)), np.empty(n), np.empty(6)
    Y, y, H = np.empty((12, 12)), np.empty(12), np.empty((6, 6))
    rounds = 6 if bound < np.inf else 1 if len(arrays.Sq) == 0 or alpha > 0.0 else 3
    Y0, T0 = prior_information(prior)
    status = recurse(
        arrays.q, arrays.p, arrays.Sq, arrays.Sp, arrays.weights,
        Y0, T0, alpha, bound, rounds, motion, weights, W, Y, y, H, chi2, sums,
    )  # fmt: skip
    if status > 0:
        raise bad_covariance(status - 1)
    return Solution(motion, H, Y, y, W, weights, chi2, sums, status == 0)


def observed_factor(solution: Solution) -> float:
    """Return the mean of chi2 of the pairs used against its expectation, 1 where that is not known."""
    freedom = 3.0 * float(solution.sums[0]) - 6.0 if solution.determined else 0.0
    return float(solution.sums[1]) / freedom if freedom > 0.0 else 1.0


def prior_information(prior: Prior | None) -> tuple[Array, Array]:
    """Return the prior's information (6 x 6, empty for none) and the motion it lies at."""
    if prior is None:
        return _NO_PRIOR, _IDENTITY
    if prior.covariance is None:
        return _NO_PRIOR, prior.T_target_source
    return np.asarray(np.linalg.inv(prior.covariance), dtype=np.float64), prior.T_target_source


class Judgement(NamedTuple):
    """What is known beside the solution: how the covariance grows, the observed variance factor, what was used."""

    inflation: float = 1.0
    variance_factor: float = 1.0
    details: Mapping[str, float] = MappingProxyType({})


def judged(arrays: Arrays, prior: Prior | None, solution: Solution, judgement: Judgement) -> Registration:
    """Return the result of a solution: its covariance, or the reason why the pairs do not give a motion."""
    n = len(arrays.q)
    inliers: NDArray[np.bool_] = solution.weights > 0.0
    used = int(solution.sums[0]) if solution.determined else int(np.count_nonzero(inliers))
    covariance, numbers = np.empty((6, 6)), np.empty(3)
    reason = ""
    if used < 3 and (prior is None or prior.covariance is None):
        reason = f"{used} pairs of {n} can be used: at least 3 are needed"
    elif not solution.determined or not assess(arrays.q, solution.W, solution.weights, solution.H, covariance, numbers):
        reason = f"{used} pairs do not determine the motion"
    elif prior is None or prior.covariance is None:
        sigma = math.sqrt(judgement.inflation * max(covariance[3, 3], covariance[4, 4], covariance[5, 5]))
        noise = min(judgement.inflation, max(1.0, judgement.variance_factor))
        if numbers[1] < _MIN_SCATTER * noise or numbers[2] < 1e-9:
            reason = f"{used} points lie on a line or in one place, within their noise"
        elif sigma > _MAX_ROTATION_SIGMA:
            reason = f"the rotation is uncertain by {math.degrees(sigma):.0f} degrees"
    if reason:
        return degenerate(n, reason, solution.chi2, inliers)
    return Registration(
        solution.T,
        covariance if judgement.inflation == 1.0 else judgement.inflation * covariance,
        inliers,
        solution.chi2,
        float(numbers[0]),
        Verdict.OK,
        variance_factor=judgement.variance_factor,
        details=dict(judgement.details),
    )
