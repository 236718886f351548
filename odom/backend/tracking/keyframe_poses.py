"""Where the key frames are whose patches are searched for, as the camera sees them."""

import numpy as np

from odom.backend.map.map import Map
from odom.geometry import se3
from odom.geometry.arrays import Array, Index


def keyframe_poses(map_: Map, keyframes: Index, T_camera_map: Array) -> Array:
    """Return T_camera_keyframe (K x 4 x 4) of K `keyframes`, seen from a pose `T_camera_map`."""
    T_keyframe_map = np.array([map_.keyframes[k].T_camera_map for k in keyframes.tolist()]).reshape(-1, 4, 4)
    return np.asarray(T_camera_map @ se3.inverses(T_keyframe_map))
