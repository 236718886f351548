"""Key frames made while older ones were adjusted: they move with those; another lens, tilt or shutter refits them."""

import numpy as np

from odom.backend.map.keyframe import Keyframe
from odom.backend.map.map import Map
from odom.backend.mapping.tuning import TUNING
from odom.backend.tracking.pose_solver import fit_pose
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3
from odom.geometry.arrays import Array


def carry_newer(map_: Map, newest: Keyframe, T_old_new: Array) -> None:
    """Move the key frames that were made after the `newest` adjusted one with it, and their landmarks with them.

    Seen from the newest, the map has moved by `T_old_new`. Left where they were, they would show a motion that the
    camera never made.
    """
    newer = _newer(map_, newest)
    T_camera_map = np.array([keyframe.T_camera_map @ T_old_new for keyframe in newer]).reshape(-1, 4, 4)
    map_.move_keyframes(np.array([keyframe.number for keyframe in newer], dtype=np.int64), T_camera_map)
    map_.registrations.adjust([keyframe.number for keyframe in newer], map_.keyframes)


def refit_newer(map_: Map, newest: Keyframe, timing: ShutterTiming, tilt: Array) -> None:
    """Fit the key frames that were made after the `newest` adjusted one to the landmarks that older ones made.

    The old lens, tilt or kind of shutter has placed them, and those landmarks have moved since. Each key frame starts
    from its pose relative to the one before it, and stays there where it shares few landmarks; its own landmarks
    follow. What they measured is already converted to the new lens; it is carried to `timing`, and the `tilt` (2) of
    depth taken out.
    """
    L, T_old_new = map_.landmarks, np.eye(4)
    newer = _newer(map_, newest)
    for keyframe in newer:
        T_camera_map = keyframe.T_camera_map @ T_old_new
        older = np.flatnonzero(keyframe.current(L) & (L.keyframe[keyframe.rows] != keyframe.number))
        if len(older) >= TUNING.adjust_shared:
            rows, measured = keyframe.rows[older], keyframe.measurements.take(older)
            values = measured.retimed(keyframe.timing.change_to(timing)).straight(tilt).values
            points, covariances = L.position[rows], L.covariance[rows]
            T_camera_map = fit_pose(points, covariances, values, measured.covariance, T_camera_map).T_camera_map
        T_old_new = se3.inverse(keyframe.T_camera_map) @ T_camera_map
        map_.move_keyframes(np.array([keyframe.number]), T_camera_map[None])
    map_.registrations.adjust([keyframe.number for keyframe in newer], map_.keyframes)


def _newer(map_: Map, newest: Keyframe) -> list[Keyframe]:
    return [keyframe for keyframe in map_.members(newest.segment) if keyframe.number > newest.number]
