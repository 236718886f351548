"""The nearest of a few hundred points: all distances are computed, which is quicker than a tree for so few."""

import numpy as np

from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import vectorised


@vectorised
def nearest(points: Array, among: Array, count: int) -> tuple[Index, Array]:
    """Return the `count` nearest of m points `among` (m x 3) to each of n `points` (n x 3), and how far the last is.

    Their numbers (n x count), nearest first, and squared distances (n). `count` must not be more than m.
    """
    n, m = points.shape[0], among.shape[0]
    near, within2 = np.zeros((n, count), np.int64), np.zeros(n)
    X, Y, Z = among[:, 0].copy(), among[:, 1].copy(), among[:, 2].copy()
    away2, best = np.empty(m), np.empty(count)
    for k in range(n):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        for j in range(m):
            dx, dy, dz = X[j] - x, Y[j] - y, Z[j] - z
            away2[j] = dx * dx + dy * dy + dz * dz
        best[:] = np.inf
        for j in range(m):
            if away2[j] >= best[count - 1]:
                continue
            # put in among the nearest so far, which are in order
            i = count - 1
            while i > 0 and best[i - 1] > away2[j]:
                best[i], near[k, i] = best[i - 1], near[k, i - 1]
                i -= 1
            best[i], near[k, i] = away2[j], j
        within2[k] = best[count - 1]
    return near, within2
