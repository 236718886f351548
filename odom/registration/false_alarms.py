"""Whether a consensus could be chance: the expected number of equally large ones among random pairs.

L. Moisan and B. Stival, "A Probabilistic Criterion to Detect Rigid Point Matches", IJCV 2004.
"""

import math
from bisect import bisect_left

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from odom.registration.checked_arrays import Arrays


def chance(p: Array, W: Array, weights: Array, bound: float) -> float:
    """Return the probability that a wrong target falls inside a pair's gate: its volume over that of the targets.

    `p` are the targets (n x 3, m), `W` the precisions (n x 8, see `measurement_covariance`), `bound` that of the gates
    (squared sigmas); pairs of weight 0 are left out. The gate of pair k is the ellipsoid `e' inv(S_k) e <= bound`, of
    volume 4/3 pi bound^1.5 sqrt(det S_k); the targets lie in their box, wider by a gate's mean radius in all.
    """
    used = weights > 0.0
    if not used.any():
        return 1.0
    volume = float(np.prod(extents(p[used]) + np.sqrt(bound / W[used, 6]).mean()))
    gates = 4.18879 * bound**1.5 * np.exp(W[used, 7])
    return float(np.minimum(1.0, gates / volume).mean())


def extents(points: Array) -> Array:
    """Return the extents (3, m) of a box around n x 3 points that a twentieth of them, if far, does not widen much.

    Of each axis the outer twentieth on either side is left out, the rest widened by half its length on either side: of
    points spread evenly that reaches beyond all, and the box ends at the last of them.
    """
    ordered = np.sort(points, axis=0)
    outer = min(max(1, len(points) // 20), (len(points) - 1) // 2)
    low, high = ordered[outer], ordered[-1 - outer]
    half = 0.5 * (high - low)
    return np.asarray(np.minimum(ordered[-1], high + half) - np.maximum(ordered[0], low - half))


def log_false_alarms(n: int, inliers: int, probability: float) -> float:
    """Return the log of how many motions with as many inliers chance would give among n pairs (an upper bound).

    `C(n, 3)` motions may be tried, each with `n - 3` free pairs; the binomial tail is bounded as Chernoff does.
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


def is_believable(arrays: Arrays, W: Array, T: Array, weights: Array, bound: float, odds: tuple[float, float]) -> bool:
    """Return whether the pairs of `weights` > 0, which agree on the motion `T`, can hardly be chance.

    `odds` are that of a wrong pair to agree (see `chance`) and the log of the false alarms allowed. Pairs that repeat a
    spot (features of several octaves, matches many to one) agree together and count once. As many spots as would be
    believable among all pairs suffice; only where the pairs have fewer are those of all pairs counted.
    """
    probability, allowed = odds
    used, inliers = int(np.count_nonzero(arrays.weights)), int(np.count_nonzero(weights))

    def is_rare(n: int, agreeing: int) -> bool:
        return log_false_alarms(n, agreeing, probability) < allowed

    enough = bisect_left(range(inliers + 1), True, key=lambda agreeing: is_rare(used, agreeing))
    if enough > inliers:
        return False
    found = spots(arrays.q, arrays.p, W, T, weights, bound, enough)
    return found == enough or is_rare(spots(arrays.q, arrays.p, W, T, arrays.weights, bound, used), found)


@compiled
def spots(q: Array, p: Array, W: Array, T: Array, g: Array, bound: float, most: int) -> int:
    """Return how many spots the pairs with `g` > 0 have, counted up to `most`.

    A pair repeats one counted before where both its points are within its own gate of that one's.
    """
    first, found = np.empty(most, dtype=np.int64), 0
    for k in range(len(q)):
        if found == most:
            break
        if not g[k] > 0.0:
            continue
        is_new = True
        for c in range(found):
            j = first[c]
            x, y, z = p[k, 0] - p[j, 0], p[k, 1] - p[j, 1], p[k, 2] - p[j, 2]
            if _chi2(W[k], x, y, z) > bound:
                continue
            a, b, d = q[k, 0] - q[j, 0], q[k, 1] - q[j, 1], q[k, 2] - q[j, 2]
            x = T[0, 0] * a + T[0, 1] * b + T[0, 2] * d
            y = T[1, 0] * a + T[1, 1] * b + T[1, 2] * d
            z = T[2, 0] * a + T[2, 1] * b + T[2, 2] * d
            if _chi2(W[k], x, y, z) <= bound:
                is_new = False
                break
        if is_new:
            first[found] = k
            found += 1
    return found


@compiled
def _chi2(w: Array, x: float, y: float, z: float) -> float:
    """Return `e' W e` of e = (x, y, z), `w` being a pair's row of `W`."""
    return float(x * (w[0] * x + 2.0 * (w[1] * y + w[2] * z)) + y * (w[3] * y + 2.0 * w[4] * z) + w[5] * z * z)
