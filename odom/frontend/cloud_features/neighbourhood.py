"""The points near each point: cubes as wide as the radius, sorted, so that compiled loops can walk over them.

Within a fixed radius this is some ten times as quick as a k-d tree, which hands out its millions of pairs as lists.
"""

from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled


class Cells(NamedTuple):
    """Points sorted by the cube of side `radius_m` that they lie in.

    `order` (n) are their numbers in that order, `keys` (m) and `first` (m + 1) the occupied cubes and where each
    begins in `order`; `corner` and `size` (3) are where the grid begins and how many cubes it has along each axis.
    """

    order: Index
    keys: Index
    first: Index
    corner: Index
    size: Index
    radius_m: float

    @classmethod
    def of(cls, points: Array, radius_m: float) -> "Cells":
        """Return the cells of n x 3 points for searches within `radius_m`."""
        cube = np.floor(points / radius_m).astype(np.int64)
        corner = cube.min(axis=0) - 1 if len(cube) else np.zeros(3, dtype=np.int64)
        cube -= corner
        size = cube.max(axis=0) + 2 if len(cube) else np.ones(3, dtype=np.int64)
        key = (cube[:, 0] * size[1] + cube[:, 1]) * size[2] + cube[:, 2]
        order = np.argsort(key, kind="stable").astype(np.int64)
        first = np.flatnonzero(np.diff(key[order], prepend=-1))
        return cls(order, key[order][first], np.append(first, len(key)).astype(np.int64), corner, size, radius_m)


@compiled
def near(point: Array, points: Array, cells: Cells, found: Index, squares: Array) -> int:
    """Write the numbers of the points within the cells' radius of `point`, and squared distances; return how many.

    `found` and `squares` are as long as the points.
    """
    radius2 = cells.radius_m * cells.radius_m
    x = np.int64(np.floor(point[0] / cells.radius_m)) - cells.corner[0]
    y = np.int64(np.floor(point[1] / cells.radius_m)) - cells.corner[1]
    z = np.int64(np.floor(point[2] / cells.radius_m)) - cells.corner[2]
    count = 0
    for i in range(max(x - 1, 0), min(x + 2, cells.size[0])):
        for j in range(max(y - 1, 0), min(y + 2, cells.size[1])):
            row = (i * cells.size[1] + j) * cells.size[2]
            low, high = max(z - 1, 0), min(z + 1, cells.size[2] - 1)
            for c in range(np.searchsorted(cells.keys, row + low), len(cells.keys)):
                if cells.keys[c] > row + high:
                    break
                for at in range(cells.first[c], cells.first[c + 1]):
                    k = cells.order[at]
                    a, b, d = points[k, 0] - point[0], points[k, 1] - point[1], points[k, 2] - point[2]
                    square = a * a + b * b + d * d
                    if square <= radius2:
                        found[count], squares[count] = k, square
                        count += 1
    return count


@compiled
def scatters(centres: Array, points: Array, cells: Cells, is_frame: bool) -> tuple[Array, Index]:
    """Return the scatter (m x 3 x 3) of the points near each of m centres, and how many points that are (m).

    It is that about their mean; for a local reference frame (`is_frame`) that about the centre, which itself does not
    count, each point weighing the radius less its distance (S. Salti et al., CVIU 125, 2014).
    """
    m = len(centres)
    sums, counts = np.zeros((m, 3, 3)), np.zeros(m, np.int64)
    found, squares = np.empty(len(points), np.int64), np.empty(len(points))
    for n in range(m):
        count = near(centres[n], points, cells, found, squares)
        mean, total, used = np.zeros(3), 0.0, 0
        for k in range(count):
            if is_frame and squares[k] == 0.0:
                continue
            w = cells.radius_m - np.sqrt(squares[k]) if is_frame else 1.0
            total += w
            used += 1
            for i in range(3):
                a = points[found[k], i] - centres[n, i]
                mean[i] += w * a
                for j in range(i + 1):
                    sums[n, i, j] += w * a * (points[found[k], j] - centres[n, j])
        counts[n] = used
        if total > 0.0:
            for i in range(3):
                for j in range(i + 1):
                    about = 0.0 if is_frame else mean[i] * mean[j] / total
                    sums[n, i, j] = sums[n, j, i] = (sums[n, i, j] - about) / total
    return sums, counts
