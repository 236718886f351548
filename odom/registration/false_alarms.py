"""Whether a consensus could be chance: the expected number of equally large ones among random pairs.

L. Moisan and B. Stival, "A Probabilistic Criterion to Detect Rigid Point Matches", IJCV 2004.
"""

import math

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled


@compiled
def chance(p: Array, W: Array, bound: float) -> float:
    """Return the probability that a wrong target falls inside a pair's gate: its volume over that of all targets.

    The gate of pair k is the ellipsoid `e' inv(S_k) e <= bound`, of volume 4/3 pi bound^1.5 sqrt(det S_k); all targets
    lie in their box, wider by a gate's mean radius on each side.
    """
    n = len(p)
    width = 0.0
    for k in range(n):
        width += np.sqrt(bound / W[k, 6])
    volume = 1.0
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
