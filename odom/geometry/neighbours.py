"""The nearest of a few hundred points: all distances are computed, which is quicker than a tree for so few."""

import numpy as np

from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import vectorised

_HALVINGS = 8
"""How often the distance within which the nearest lie is halved at most, before those within it are put in order."""
_WIDER = 1e-12
"""Added to a distance that is doubled, so that none stays 0 (m^2)."""
_TOO_MANY = 4
"""So many more than asked for are put in order rather than counted once more."""


@vectorised
def nearest(points: Array, among: Array, count: int) -> tuple[Index, Array]:
    """Return the `count` nearest of m points `among` (m x 3) to each of n `points` (n x 3), and how far the last is.

    Their numbers (n x count), nearest first, and squared distances (n). `count` must not be more than m.

    Points within a distance are counted, several at a time, until hardly more than `count` are left to be put in order.
    It begins with that of the point before: who is next in number is often near.
    """
    n, m = points.shape[0], among.shape[0]
    near, within2 = np.zeros((n, count), np.int64), np.zeros(n)
    X, Y, Z = among[:, 0].copy(), among[:, 1].copy(), among[:, 2].copy()
    away2, left, left_away2 = np.empty(m), np.zeros(m, np.int64), np.zeros(m)
    outer = 0.0
    for k in range(n):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        for j in range(m):
            dx, dy, dz = X[j] - x, Y[j] - y, Z[j] - z
            away2[j] = dx * dx + dy * dy + dz * dz
        inner, within = 0.0, 0
        for j in range(m):
            within += away2[j] <= outer
        while within < count and outer < np.inf:
            inner, outer, within = outer, 2.0 * outer + _WIDER, 0
            for j in range(m):
                within += away2[j] <= outer
        for _ in range(_HALVINGS):
            if within <= count + _TOO_MANY:
                break
            middle, closer = 0.5 * (inner + outer), 0
            for j in range(m):
                closer += away2[j] <= middle
            if closer < count:
                inner = middle
            else:
                outer, within = middle, closer
        found = 0
        for j in range(m):
            left[found] = j
            found += away2[j] <= outer
        for s in range(found):
            number, away, i = left[s], away2[left[s]], s
            while i > 0 and left_away2[i - 1] > away:
                left[i], left_away2[i] = left[i - 1], left_away2[i - 1]
                i -= 1
            left[i], left_away2[i] = number, away
        for s in range(count):
            near[k, s] = left[s]
        within2[k] = left_away2[count - 1]
        outer = outer if found >= count else 0.0
    return near, within2
