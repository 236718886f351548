"""Which key frames of a map say least: those whose landmarks fill parts of views that are full without them.

The view of every key frame is divided into squares, and in each the landmarks are counted that this key frame and those
linked with it have made. The worth of a map is the sum of the logarithms of these counts, so that the last landmarks of
a square count most; the key frame that costs least is taken away, again and again (greedily, as A. Krause and D.
Golovin, "Submodular function maximization", 2014).
"""

from collections.abc import Callable, Collection

import numpy as np
from scipy.sparse import csc_matrix

from odom.backend.map.map import Map
from odom.frame import Camera
from odom.geometry import se3
from odom.geometry.arrays import Array, Index

_SQUARES = (4, 3)
"""Into which an image is divided: a pose needs landmarks on all sides."""


def least_telling(shown: csc_matrix, surplus: int, needed: Collection[int]) -> list[int]:
    """Return up to `surplus` key frames to take away, in this order, without those `needed`.

    `shown` (squares x key frames) counts the landmarks of a key frame in each square of each view.
    """
    square, each = shown.indices, shown.data.copy()
    number = np.repeat(np.arange(shown.shape[1]), np.diff(shown.indptr))
    counts = np.asarray(shown.sum(axis=1), dtype=np.float64).ravel()
    is_free = np.ones(shown.shape[1], dtype=np.bool_)
    is_free[list(needed)] = False
    taken: list[int] = []
    for _ in range(min(surplus, int(is_free.sum()))):
        lost = np.log1p(counts[square]) - np.log1p(counts[square] - each)
        cost = np.bincount(number, lost, minlength=shown.shape[1])
        worst = int(np.argmin(np.where(is_free, cost, np.inf)))
        taken.append(worst)
        is_free[worst] = False
        column = slice(shown.indptr[worst], shown.indptr[worst + 1])
        counts[square[column]] -= each[column]
        each[column] = 0.0
    return taken


def landmarks_shown(map_: Map, camera: Camera, landmarks_of: Callable[[int], Array]) -> csc_matrix:
    """Return how many landmarks of each key frame are in each square of the views that it is linked with.

    `landmarks_of` a key frame are its own ones (n x 3, its camera frame).
    """
    squares = _SQUARES[0] * _SQUARES[1]
    rows: list[Index] = []
    columns: list[Index] = []
    for keyframe in map_.keyframes:
        points, T_map_camera = landmarks_of(keyframe.number), se3.inverse(keyframe.T_camera_map)
        for viewer in sorted(map_.links[keyframe.number] | {keyframe.number}):
            T_viewer_keyframe = map_.keyframes[viewer].T_camera_map @ T_map_camera
            square = _squares(se3.apply(T_viewer_keyframe, points), camera)
            rows.append(viewer * squares + square)
            columns.append(np.full(len(square), keyframe.number))
    count = len(map_.keyframes)
    at = np.concatenate([np.zeros(0, np.int64), *rows]), np.concatenate([np.zeros(0, np.int64), *columns])
    return csc_matrix((np.ones(len(at[0])), at), shape=(count * squares, count))


def _squares(points: Array, camera: Camera) -> Index:
    """Return the square of each point (n x 3, m) that is in the image; the lens is taken as straight."""
    x, y, z = points[points[:, 2] > 0.0].T
    across = (camera.fx * x / z + camera.cx) / camera.width
    down = (camera.fy * y / z + camera.cy) / camera.height
    is_seen = (across >= 0.0) & (across < 1.0) & (down >= 0.0) & (down < 1.0)
    column, row = (across[is_seen] * _SQUARES[0]).astype(np.int64), (down[is_seen] * _SQUARES[1]).astype(np.int64)
    return np.asarray(row * _SQUARES[0] + column)
