"""Pairs that can belong to one rigid motion, because their distances agree: a start among mostly wrong pairs."""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled

Array = NDArray[np.float64]

_TOLERANCE = 3.0**2
_PARTNERS = 24


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
    return bool(difference * difference <= _TOLERANCE * variance)


@compiled
def rate(q: Array, p: Array, Sq: Array, Sp: Array, base: Array, rating: Array) -> None:
    """Set `rating[s]` to the number of pairs compatible with seed s, the pair `s n // len(rating)`."""
    n = len(q)
    for s in range(len(rating)):
        i = s * n // len(rating)
        rating[s] = 0.0
        for k in range(n):
            if base[i] > 0.0 and base[k] > 0.0 and compatible(q, p, Sq, Sp, i, k):
                rating[s] += 1.0


@compiled
def rigid_set(q: Array, p: Array, Sq: Array, Sp: Array, base: Array, i: int, mask: Array) -> int:
    """Fill `mask` with the weights of the pairs compatible with i and the best partner; return their number."""
    n = len(q)
    member = np.empty(n, dtype=np.int64)
    size = 0
    for k in range(n):
        mask[k] = 0.0
        if base[k] > 0.0 and compatible(q, p, Sq, Sp, i, k):
            member[size] = k
            size += 1
    most, partner = 0, i
    for a in range(0, size, max(1, size // _PARTNERS)):
        common = 0
        for c in range(size):
            common += compatible(q, p, Sq, Sp, member[a], member[c])
        if common > most:
            most, partner = common, member[a]
    mask[i], mask[partner] = base[i], base[partner]
    for c in range(size):
        if compatible(q, p, Sq, Sp, partner, member[c]):
            mask[member[c]] = base[member[c]]
    return most + 2
