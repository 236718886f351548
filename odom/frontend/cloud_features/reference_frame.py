"""SHOT's local reference frame: three directions at a point that turn with the surface around it.

F. Tombari, S. Salti and L. Di Stefano, "Unique signatures of histograms for local surface description", ECCV 2010.
"""

import numpy as np

from odom.frontend.cloud_features.neighbourhood import Cells, near, scatters
from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled

LEAST_POINTS = 5
"""Fewer neighbours than this give no frame and no descriptor."""
_MIDDLE = 5
"""Where as many points lie on either side, so many at the middle distances decide."""


def reference_frames(centres: Array, points: Array, cells: Cells) -> Array:
    """Return the frame (m x 3 x 3, rows x, y, z) at each of m centres among the points; NaN where they are too few.

    x is the direction in which the points spread most, z the one in which they do least; each points to where most of
    the points are.
    """
    sums, counts = scatters(centres, points, cells, True)
    directions = np.linalg.eigh(sums)[1]
    frames = np.empty((len(centres), 3, 3))
    frames[:, 0], frames[:, 2] = directions[:, :, 2], directions[:, :, 0]
    point_to_most(centres, points, cells, frames)
    frames[:, 1] = np.cross(frames[:, 2], frames[:, 0])
    frames[counts < LEAST_POINTS] = np.nan
    return frames


@compiled
def point_to_most(centres: Array, points: Array, cells: Cells, frames: Array) -> None:
    """Turn the x and z axes of `frames` to the side where most of the points near the centres are."""
    found, squares = np.empty(len(points), np.int64), np.empty(len(points))
    for n in range(len(centres)):
        count = near(centres[n], points, cells, found, squares)
        for axis in (0, 2):
            ahead = used = 0
            for k in range(count):
                if squares[k] > 0.0:
                    used += 1
                    ahead += _along(centres[n], points[found[k]], frames[n, axis]) >= 0.0
            if 2 * ahead == used:
                ahead, used = _at_the_middle(centres[n], points, frames[n, axis], found[:count], squares[:count])
            if 2 * ahead < used:
                frames[n, axis] *= -1.0


@compiled
def _along(centre: Array, point: Array, axis: Array) -> float:
    total = 0.0
    for i in range(3):
        total += (point[i] - centre[i]) * axis[i]
    return total


@compiled
def _at_the_middle(centre: Array, points: Array, axis: Array, found: Index, squares: Array) -> tuple[int, int]:
    """Return how many of the five points of middle distance lie ahead along `axis`, and how many were looked at."""
    nearest_first = np.argsort(squares)
    begin = 0
    while begin < len(squares) and squares[nearest_first[begin]] == 0.0:
        begin += 1
    middle = begin + (len(squares) - begin) // 2
    ahead = used = 0
    for at in range(max(begin, middle - _MIDDLE // 2), min(len(squares), middle + _MIDDLE // 2 + 1)):
        used += 1
        ahead += _along(centre, points[found[nearest_first[at]]], axis) > 0.0
    return ahead, used
