"""Whether a consensus could be chance: the expected number of equally large ones among random pairs.

L. Moisan and B. Stival, "A Probabilistic Criterion to Detect Rigid Point Matches", IJCV 2004.
"""

import math

import numpy as np

from odom.geometry.arrays import Array


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
