"""Landmarks of the map with the key frames that hold their patches, as they may be looked for from a pose."""

import numpy as np

from odom.backend.map.map import Map
from odom.frontend.matching.landmark_search import Candidates
from odom.geometry import se3
from odom.geometry.arrays import Array, Index


def candidates_of(map_: Map, rows: Index, priority: Array, keyframes: Index, T_camera_map: Array) -> Candidates:
    """Return the landmarks `rows` (n) of some `keyframes` (K numbers, ascending), seen from a pose `T_camera_map`.

    `priority` (n) says which are looked for first where there are too many.
    """
    T_keyframe_map = np.array([map_.keyframes[k].T_camera_map for k in keyframes.tolist()]).reshape(-1, 4, 4)
    return Candidates(rows, priority, keyframes, T_camera_map @ se3.inverses(T_keyframe_map))
