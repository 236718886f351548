"""The gate for wrong pairs: graduated non-convexity, and a search by rigidity where that is not enough.

H. Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020, here with each pair's own
covariance in the residual. A consensus counts only if chance would not produce it: the expected number of false
alarms of L. Moisan and B. Stival, "A Probabilistic Criterion to Detect Rigid Point Matches", IJCV 2004.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.registration.compiled import compiled
from odom.registration.kernels import accumulate, mahalanobis, precisions, unpack
from odom.registration.motion import horn
from odom.registration.projection import project
from odom.registration.rigidity import rate, rigid_set

Array = NDArray[np.float64]

BOUND = 16.27
"""The .999 quantile of chi-square with 3 degrees of freedom: beyond it a pair is wrong."""
FALSE_ALARMS = math.log(1e-4)
"""A consensus is believed when chance would give fewer motions like it than this."""
_GROWTH = 1.4
_TURN = np.cos(0.05)
_SEEDS = 120
_TRIALS = 12


def bad_covariance(k: int) -> InputError:
    """Return the error that names the pair whose covariance cannot be used."""
    return InputError(f"the covariance of pair {k} is not positive definite: leave it out, or add the pixel's noise")


@compiled
def turned(R: Array, T: Array) -> bool:
    """Return whether `T` is rotated against `R` by more than .05 rad, so that `R Sq R'` must be computed anew."""
    trace = 0.0
    for i in range(3):
        for j in range(3):
            trace += R[i, j] * T[i, j]
    return bool(0.5 * (trace - 1.0) < _TURN)


@compiled
def graduate(
    q: Array,
    p: Array,
    Sq: Array,
    Sp: Array,
    base: Array,
    T: Array,
    near: bool,
    bound: float,
    W: Array,
    g: Array,
    chi2: Array,
) -> int:
    """Move `T` to a minimum of the truncated least squares of the pairs with `base` > 0; fill `g`, `chi2`, `W`.

    `near` says that `T` is a prediction to begin at; without it all pairs begin with full weight. Weights `g` end at
    0 or `base`. Returns the number of rounds, or -1 - k if the covariance of pair k is not positive.
    """
    n = len(q)
    empty = np.empty((0, 0))
    Y = np.empty((12, 12))
    H = np.empty((6, 6))
    R = np.empty((3, 3))
    used = 0
    for k in range(n):
        g[k] = base[k]
        used += base[k] > 0.0
    mu = -1.0
    for round_ in range(1, 101):
        if round_ == 1 or turned(R, T):
            for i in range(3):
                for j in range(3):
                    R[i, j] = T[i, j]
            bad = precisions(Sq, Sp, R, 0.0, W)
            if bad >= 0:
                return -1 - bad
        if round_ > 1 or not near:
            fine = False
            if mu > 0.02:  # near enough for the full precisions
                A = np.zeros((6, 10))
                y = np.zeros(12)
                accumulate(q, p, W, g, A, y)
                unpack(A, Y)
                fine = project(Y, y, empty, T, T, H) > 0
            if not fine and not horn(q, p, W, g, T) > 0.0:
                return round_
        mahalanobis(q, p, W, T, chi2)
        if mu < 0.0:  # convex enough for the worst pair; from a prediction, for the better half of the pairs
            reach = bound
            inside = 0
            while reach < 1e12 and inside < (0.5 if near else 1.0) * used:
                reach *= 1.4
                inside = 0
                for k in range(n):
                    inside += base[k] > 0.0 and chi2[k] <= reach
            mu = bound / (2.0 * reach - bound)
        else:
            mu *= _GROWTH
        lower, upper = mu / (mu + 1.0) * bound, (mu + 1.0) / mu * bound
        undecided = 0
        for k in range(n):
            if not chi2[k] < upper:
                g[k] = 0.0
            elif chi2[k] <= lower:
                g[k] = base[k]
            else:
                undecided += base[k] > 0.0
                g[k] = base[k] * (np.sqrt(bound * mu * (mu + 1.0) / chi2[k]) - mu)
        if (undecided == 0 and mu > 0.5) or mu > 50.0:
            break
    for k in range(n):
        g[k] = base[k] if chi2[k] <= bound else 0.0
    return round_


@compiled
def chance(p: Array, W: Array, bound: float) -> float:
    """Return the probability that a wrong target falls inside a pair's gate: its volume over that of all targets."""
    volume = 1.0
    n = len(p)
    width = 0.0
    for k in range(n):
        width += np.sqrt(bound / W[k, 6])
    for i in range(3):
        low = high = p[0, i]
        for k in range(n):
            low, high = min(low, p[k, i]), max(high, p[k, i])
        volume *= high - low + width / n
    total = 0.0
    for k in range(n):
        total += min(1.0, 4.18879 * bound**1.5 * np.exp(W[k, 7]) / volume)
    return total / n


def log_false_alarms(n: int, inliers: int, probability: float) -> float:
    """Return the log of how many motions chance would give as many inliers among n pairs (an upper bound).

    `C(n, 3)` motions may be tried, each with `n - 3` free pairs; the binomial tail by Chernoff's bound.
    """
    if inliers < 3:
        return math.inf
    tries = math.log(n * (n - 1.0) * (n - 2.0) / 6.0)
    free, agreeing = n - 3, inliers - 3
    if agreeing <= free * probability:
        return tries
    share = agreeing / free
    exponent = share * math.log(share / probability)
    if share < 1.0:
        exponent += (1.0 - share) * math.log((1.0 - share) / (1.0 - probability))
    return tries - free * exponent


@dataclass(frozen=True, eq=False)
class Gated:
    """What passed the gate: weights and squared residuals (n each), and the motion they agree on.

    Weights of wrong pairs are 0; `believable` says whether so many pairs agree that chance cannot be the reason.
    """

    weights: Array
    chi2: Array
    T_target_source: Array
    rounds: int
    believable: bool

    @property
    def inliers(self) -> int:
        """The number of pairs that passed."""
        return int(np.count_nonzero(self.weights))


def gate(q: Array, p: Array, Sq: Array, Sp: Array, base: Array, T: Array, near: bool, bound: float = BOUND) -> Gated:
    """Return the pairs that agree on one motion, each within `bound` of its own covariance.

    Arguments as in `graduate`; `T` is where to begin if `near`. Where graduation ends in a consensus that chance may
    have made, rigid sets of pairs are graduated instead, the best rated seeds first, until one is believable. O(n) in
    time and memory. Raises InputError for a covariance that is not positive.
    """
    n = len(q)
    W = np.empty((n, 8))
    chi2 = np.empty(n)

    def attempt(mask: Array, start: Array, is_near: bool) -> Gated:
        motion, weights = start.copy(), np.empty(n)
        rounds = graduate(q, p, Sq, Sp, mask, motion, is_near, bound, W, weights, chi2)
        if rounds < 0:
            raise bad_covariance(-1 - rounds)
        agreeing = np.where(chi2 <= bound, base, 0.0)
        believable = log_false_alarms(used, int(np.count_nonzero(agreeing)), probability()) < FALSE_ALARMS
        return Gated(agreeing, chi2.copy(), motion, rounds, believable)

    @cache
    def probability() -> float:
        return chance(p, W, bound)

    used = int(np.count_nonzero(base))
    best = attempt(base, T, near)
    if best.believable or used < 4:
        return best
    rating, mask = np.empty(min(n, _SEEDS)), np.empty(n)
    rate(q, p, Sq, Sp, base, rating)
    for seed in np.argsort(-rating, kind="stable")[:_TRIALS]:
        if rigid_set(q, p, Sq, Sp, base, int(seed) * n // len(rating), mask) < 4:
            continue
        found = attempt(mask, np.eye(4), False)
        if found.believable or found.inliers > best.inliers:
            best = found
        if best.believable:
            break
    return best
