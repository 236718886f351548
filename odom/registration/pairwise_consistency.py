"""Pairs that can belong to one rigid motion, because their distances agree: where to begin among mostly wrong pairs."""

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from odom.registration.checked_arrays import Arrays


@compiled
def variance_along(C: Array, u0: float, u1: float, u2: float, squared: float) -> float:
    """Return the variance `u'C u / u'u` of a point of covariance `C` (3 x 3) along u, whose squared length is given."""
    e = u0 * (C[0, 0] * u0 + 2.0 * (C[0, 1] * u1 + C[0, 2] * u2)) + u1 * (C[1, 1] * u1 + 2.0 * C[1, 2] * u2)
    return float((e + C[2, 2] * u2 * u2) / squared)


@compiled
def compatible(arrays: Arrays, i: int, k: int, tolerance: float) -> bool:
    """Return whether `||p_k - p_i| - |q_k - q_i||^2` is within `tolerance` times its variance (False for i = k)."""
    if i == k:
        return False
    q, p, Sq, Sp, _ = arrays
    u0, u1, u2 = p[k, 0] - p[i, 0], p[k, 1] - p[i, 1], p[k, 2] - p[i, 2]
    v0, v1, v2 = q[k, 0] - q[i, 0], q[k, 1] - q[i, 1], q[k, 2] - q[i, 2]
    du = u0 * u0 + u1 * u1 + u2 * u2
    dv = v0 * v0 + v1 * v1 + v2 * v2
    difference = np.sqrt(du) - np.sqrt(dv)
    variance = 0.0
    if len(Sp) > 0 and du > 0.0:
        variance += variance_along(Sp[i], u0, u1, u2, du)
        variance += variance_along(Sp[k], u0, u1, u2, du)
    if len(Sq) > 0 and dv > 0.0:
        variance += variance_along(Sq[i], v0, v1, v2, dv)
        variance += variance_along(Sq[k], v0, v1, v2, dv)
    return bool(difference * difference <= tolerance * variance)


@compiled
def rate(arrays: Arrays, tolerance: float, rating: Array) -> None:
    """Set `rating[s]` to the number of pairs compatible with seed s, which is pair `s n // len(rating)`."""
    n, given = len(arrays.q), arrays.weights
    for s in range(len(rating)):
        i = s * n // len(rating)
        rating[s] = 0.0
        for k in range(n):
            if given[i] > 0.0 and given[k] > 0.0 and compatible(arrays, i, k, tolerance):
                rating[s] += 1.0


@compiled
def rigid_set(arrays: Arrays, tolerance: float, partners: int, i: int, mask: Array) -> int:
    """Fill `mask` with the weights of the pairs compatible with pair i and its best partner; return their number.

    The best partner is the pair with most compatible pairs among those compatible with i. Of these all are tried, or
    every second, third and so on, such that it is at least `partners` and fewer than twice as many.
    """
    n, given = len(arrays.q), arrays.weights
    member = np.empty(n, dtype=np.int64)
    size = 0
    for k in range(n):
        mask[k] = 0.0
        if given[k] > 0.0 and compatible(arrays, i, k, tolerance):
            member[size] = k
            size += 1
    most, partner = 0, i
    for a in range(0, size, max(1, size // partners)):
        common = 0
        for c in range(size):
            common += compatible(arrays, member[a], member[c], tolerance)
        if common > most:
            most, partner = common, member[a]
    mask[i], mask[partner] = given[i], given[partner]
    for c in range(size):
        if compatible(arrays, partner, member[c], tolerance):
            mask[member[c]] = given[member[c]]
    return most + 2
