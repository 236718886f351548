"""Key frames made while a whole segment was adjusted to another lens or tilt: fitted to the map as it is by that."""

import numpy as np

from odom.backend.map.keyframe import Keyframe
from odom.backend.map.map import Map
from odom.backend.mapping.tuning import TUNING
from odom.backend.tracking.pose_solver import fit_pose
from odom.frontend.camera.depth_tilt import without_tilt
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3
from odom.geometry.arrays import Array


def refit_newer(map_: Map, newest: Keyframe, T_old_new: Array, timing: ShutterTiming, tilt: Array) -> None:
    """Fit the key frames that were made after the `newest` adjusted one to the landmarks that older ones made.

    By the old lens or tilt they were placed where the same landmarks are no longer. Each starts from where it was in
    the map around the one before it, which has moved by `T_old_new` around the newest, and stays there where it shares
    little; its own landmarks follow. What they measured is told through the new lens already; it is carried to
    `timing`, without the `tilt` (2) of its depth.
    """
    L = map_.landmarks
    newer = [keyframe for keyframe in map_.members(newest.segment) if keyframe.number > newest.number]
    for keyframe in newer:
        T_camera_map = keyframe.T_camera_map @ T_old_new
        older = np.flatnonzero(keyframe.current(L) & (L.keyframe[keyframe.rows] != keyframe.number))
        if len(older) >= TUNING.adjust_shared:
            rows, measured = keyframe.rows[older], keyframe.measurements.take(older)
            values = without_tilt(measured.retimed(keyframe.timing.change_to(timing)), tilt)
            points, covariances = L.position[rows], L.covariance[rows]
            T_camera_map = fit_pose(points, covariances, values, measured.covariance, T_camera_map).T_camera_map
        T_old_new = se3.inverse(keyframe.T_camera_map) @ T_camera_map
        map_.move_keyframes(np.array([keyframe.number]), T_camera_map[None], np.zeros(0, dtype=np.int64))
    map_.registrations.adjust([keyframe.number for keyframe in newer], map_.keyframes)
