"""The default path at frame rate: gate, recursion in information form and weighted projection in one compiled call."""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from odom.registration.gate import FALSE_ALARMS, chance, graduate, log_false_alarms, search
from odom.registration.kernels import accumulate, assess, mahalanobis, precisions, project, unpack

Array = NDArray[np.float64]


@compiled
def finite(values: Array) -> bool:
    """Return whether all n x 3 values are finite."""
    total = 0.0
    for k in range(len(values)):
        total += 0.0 * (values[k, 0] + values[k, 1] + values[k, 2])
    return total == 0.0


@compiled
def register_pairs(
    q: Array,
    p: Array,
    Sq: Array,
    Sp: Array,
    base: Array,
    Y0: Array,
    T0: Array,
    near: bool,
    gated: bool,
    bound: float,
    T: Array,
    covariance: Array,
    Y: Array,
    y: Array,
    g: Array,
    chi2: Array,
    numbers: Array,
) -> int:
    """Register n >= 3 pairs; every array from `T` on is output.

    `base` are the pairs' weights, `Y0` (6 x 6 or empty) and `T0` the prior. `Y` (12 x 12) and `y` are the recursion's
    information, `g` the weights after the gate, `numbers` = (inliers, sum of their chi2, log false alarms, rounds,
    conditioning, second eigenvalue of the scatter against noise, the same against the first). Returns 0, 1 + k when
    the covariance of pair k cannot be used, -1 no consensus, -2 singular, -3 points that are not finite, -4 weights
    that are not finite and >= 0.
    """
    n = len(q)
    W = np.empty((n, 8))
    H = np.empty((6, 6))
    if not (finite(q) and finite(p)):
        return -3
    for k in range(n):
        if not (base[k] >= 0.0 and base[k] < np.inf):
            return -4
    for i in range(4):
        for j in range(4):
            T[i, j] = T0[i, j]
    numbers[2] = -np.inf
    if gated:
        rounds = graduate(q, p, Sq, Sp, base, T, near, bound, W, g, chi2)
        if rounds < 0:
            return -rounds
        used = inliers = 0
        for k in range(n):
            used += base[k] > 0.0
            inliers += g[k] > 0.0
        probability = chance(p, W, bound)
        if inliers < 3 or log_false_alarms(used, inliers, probability) > FALSE_ALARMS:
            other = np.eye(4)
            W2 = np.empty((n, 8))
            g2 = np.empty(n)
            chi22 = np.empty(n)
            found = search(q, p, Sq, Sp, base, other, bound, probability, W2, g2, chi22)
            if found > inliers:
                inliers = found
                for k in range(n):
                    g[k] = g2[k]
                for i in range(4):
                    for j in range(4):
                        T[i, j] = other[i, j]
        numbers[0] = inliers
        numbers[3] = rounds
        if inliers < 3:
            return -1
        numbers[2] = log_false_alarms(used, inliers, probability)
        if numbers[2] > FALSE_ALARMS:
            return -1
    else:
        for k in range(n):
            g[k] = base[k]
    for _ in range(6 if gated else 3):
        bad = precisions(Sq, Sp, T, 0.0, W)
        if bad >= 0:
            return 1 + bad
        A = np.zeros((6, 10))
        for i in range(12):
            y[i] = 0.0
        accumulate(q, p, W, g, A, y)
        unpack(A, Y)
        if project(Y, y, Y0, T0, T, H) == 0:
            return -2
        mahalanobis(q, p, W, T, chi2)
        changed = 0
        if gated:
            for k in range(n):
                now = base[k] if chi2[k] <= bound else 0.0
                changed += now != g[k]
                g[k] = now
        numbers[0] = numbers[1] = 0.0
        for k in range(n):
            if g[k] > 0.0:
                numbers[0] += 1.0
                numbers[1] += chi2[k]
        if gated and changed == 0:
            break
    if numbers[0] < 3.0 or not assess(q, W, g, H, covariance, numbers[4:]):
        return -2
    return 0
