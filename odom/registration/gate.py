"""The gate for wrong pairs: graduated non-convexity, and a search by rigidity where that is not enough.

H. Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020, here with each pair's own
covariance in the residual. A consensus counts only if chance would not produce it: the expected number of false
alarms of L. Moisan and B. Stival, "A Probabilistic Criterion to Detect Rigid Point Matches", IJCV 2004.
"""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from odom.registration.kernels import accumulate, horn, mahalanobis, precisions, project, unpack

Array = NDArray[np.float64]

BOUND = 16.27
"""The .999 quantile of chi-square with 3 degrees of freedom: beyond it a pair is wrong."""
FALSE_ALARMS = np.log(1e-4)
"""A consensus is believed when chance would give fewer motions like it than this."""
_GROWTH = 1.4
_TURN = np.cos(0.05)
_PAIR_TOLERANCE = 3.0**2


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


@compiled
def log_false_alarms(n: int, inliers: int, probability: float) -> float:
    """Return the log of how many motions chance would give as many inliers among n pairs (an upper bound).

    `C(n, 3)` motions may be tried, each with `n - 3` free pairs; the binomial tail by Chernoff's bound.
    """
    tries = np.log(n * (n - 1.0) * (n - 2.0) / 6.0)
    m, j = n - 3.0, inliers - 3.0
    if j <= m * probability:
        return float(tries)
    f = j / m
    exponent = f * np.log(f / probability)
    if f < 1.0:
        exponent += (1.0 - f) * np.log((1.0 - f) / (1.0 - probability))
    return float(tries - m * exponent)


@compiled
def compatible(q: Array, p: Array, Sq: Array, Sp: Array, i: int, k: int) -> bool:
    """Return whether pairs i and k can be of one rigid motion: their distances agree within the noise along them."""
    if i == k:
        return False
    u0, u1, u2 = p[k, 0] - p[i, 0], p[k, 1] - p[i, 1], p[k, 2] - p[i, 2]
    v0, v1, v2 = q[k, 0] - q[i, 0], q[k, 1] - q[i, 1], q[k, 2] - q[i, 2]
    du = u0 * u0 + u1 * u1 + u2 * u2
    dv = v0 * v0 + v1 * v1 + v2 * v2
    difference = np.sqrt(du) - np.sqrt(dv)
    variance = 0.0
    if len(Sp) > 0 and du > 0.0:
        for s in (i, k):
            C = Sp[s]
            e = u0 * (C[0, 0] * u0 + 2.0 * (C[0, 1] * u1 + C[0, 2] * u2)) + u1 * (C[1, 1] * u1 + 2.0 * C[1, 2] * u2)
            variance += (e + C[2, 2] * u2 * u2) / du
    if len(Sq) > 0 and dv > 0.0:
        for s in (i, k):
            C = Sq[s]
            e = v0 * (C[0, 0] * v0 + 2.0 * (C[0, 1] * v1 + C[0, 2] * v2)) + v1 * (C[1, 1] * v1 + 2.0 * C[1, 2] * v2)
            variance += (e + C[2, 2] * v2 * v2) / dv
    return bool(difference * difference <= _PAIR_TOLERANCE * variance)


@compiled
def search(
    q: Array,
    p: Array,
    Sq: Array,
    Sp: Array,
    base: Array,
    T: Array,
    bound: float,
    probability: float,
    W: Array,
    g: Array,
    chi2: Array,
) -> int:
    """Look for a motion among pairs of which most are wrong: sets of pairs whose distances agree, each graduated.

    Up to 120 seeds are rated by the number of pairs compatible with them, the best 12 refined by a second pair, until
    one gives a consensus beyond chance. Cost O(120 n), memory O(n). Leaves the motion with most inliers in `T` (with
    `g`, `chi2`, `W`), returns their number, 0 when nothing was found.
    """
    n = len(q)
    seeds = min(n, 120)
    rating = np.zeros(seeds, dtype=np.int64)
    for s in range(seeds):
        i = s * n // seeds
        if base[i] > 0.0:
            for k in range(n):
                rating[s] += base[k] > 0.0 and compatible(q, p, Sq, Sp, i, k)
    mask = np.zeros(n)
    member = np.empty(n, dtype=np.int64)
    trial = np.eye(4)
    trial_g = np.empty(n)
    trial_chi2 = np.empty(n)
    best = 0
    for _ in range(12):
        s = 0
        for other in range(1, seeds):
            if rating[other] > rating[s]:
                s = other
        if rating[s] < 3:
            break
        rating[s] = 0
        i = s * n // seeds
        size = 0
        for k in range(n):
            if base[k] > 0.0 and compatible(q, p, Sq, Sp, i, k):
                member[size] = k
                size += 1
        most, second = 0, member[0]
        for a in range(0, size, max(1, size // 24)):
            common = 0
            for c in range(size):
                common += compatible(q, p, Sq, Sp, member[a], member[c])
            if common > most:
                most, second = common, member[a]
        if most < 2:
            continue
        for k in range(n):
            mask[k] = 0.0
        mask[i], mask[second] = base[i], base[second]
        for c in range(size):
            if compatible(q, p, Sq, Sp, second, member[c]):
                mask[member[c]] = base[member[c]]
        if graduate(q, p, Sq, Sp, mask, trial, False, bound, W, trial_g, trial_chi2) < 0:
            return 0
        count = 0
        for k in range(n):
            count += base[k] > 0.0 and trial_chi2[k] <= bound
        if count > best:
            best = count
            for r in range(4):
                for c in range(4):
                    T[r, c] = trial[r, c]
            if best > 3 and log_false_alarms(n, best, probability) < FALSE_ALARMS:
                break
    if best > 0:
        precisions(Sq, Sp, T, 0.0, W)
        mahalanobis(q, p, W, T, chi2)
        for k in range(n):
            g[k] = base[k] if chi2[k] <= bound else 0.0
    return best
