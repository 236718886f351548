"""How sure the motion between two frames is, by the key frames between them and the errors that frames share."""

import numpy as np

from odom.backend.map.frame_log import LoggedFrame
from odom.backend.map.keyframe import Keyframe
from odom.backend.map.map import Map
from odom.backend.map.tuning import TUNING
from odom.geometry import se3
from odom.geometry.arrays import Array

_I6 = np.eye(6)
"""The covariance of a motion that is known to one metre and one radian."""


def independent_covariance(covariance: Array) -> Array:
    """Return the 6 x 6 covariance of a frame against one so long ago that they share no errors any more."""
    return (1.0 + TUNING.shared_error) * covariance


def calibration_covariance(T_earlier_current: Array, calibration_error: float) -> Array:
    """Return the 6 x 6 covariance that a wrong calibration adds to a motion, as the share `calibration_error` of it.

    A wrong focal length takes rotation for translation, at a scene depth of about a metre.
    """
    moved = calibration_error * se3.log(T_earlier_current)
    return np.asarray(float(moved @ moved) * _I6)


def unit_covariance(T_earlier_current: Array) -> Array:
    """Return the 6 x 6 covariance (`se3`, current frame) that a motion has because the unit of depth is not exact.

    All that is measured is too long, or too short, by the same share, so the motion errs along its own direction.
    """
    moved = np.zeros(6)
    moved[:3] = TUNING.unit_of_length * (T_earlier_current[:3, :3].T @ T_earlier_current[:3, 3])
    return moved[:, None] * moved


def common_covariance(T_earlier_current: Array, calibration_error: float) -> Array:
    """Return the 6 x 6 covariance of a motion from errors common to all measurements: calibration and unit."""
    return calibration_covariance(T_earlier_current, calibration_error) + unit_covariance(T_earlier_current)


def delay_covariance(A_current_earlier: Array, earlier: Array, current: Array, delay_variance: float) -> Array:
    """Return the 6 x 6 covariance (current camera frame) of a motion between stamps whose delays err alike.

    The delay is that from the middle row's time to the stamp, known with `delay_variance` (s^2); meanwhile the camera
    moves with the twists `earlier` and `current` (6, SI, camera frame) at the two. `A_current_earlier` (6 x 6) is the
    adjoint of the motion between them.
    """
    moved = current - A_current_earlier @ earlier
    return np.asarray(delay_variance * moved[:, None] * moved)


def relative_covariance(
    map_: Map,
    earlier: LoggedFrame,
    current: LoggedFrame,
    T_earlier_current: Array,
    calibration_error: float,
    delay_variance: float,
) -> Array | None:
    """Return the 6 x 6 covariance (`se3`, current camera frame) of the motion `T_earlier_current` as it was published.

    None where a frame is LOST or the two are in different segments. Each frame's own error is white; the errors that
    frames share fade exponentially with time (Ornstein-Uhlenbeck). What the map has moved by since the earlier frame
    was published is an error that the motion is known to have. `delay_variance` as in `delay_covariance`.
    """
    if earlier.keyframe is None or earlier.T_keyframe_camera is None or earlier.covariance is None:
        return None
    if current.keyframe is None or current.T_keyframe_camera is None or current.covariance is None:
        return None
    a, b = map_.keyframes[earlier.keyframe], map_.keyframes[current.keyframe]
    between = map_.registrations.covariance_between(a.number, b.number) if a.segment == b.segment else None
    if between is None:
        return None
    T_current_b = se3.inverse(current.T_keyframe_camera)
    T_current_earlier = T_current_b @ b.T_camera_map @ se3.inverse(a.T_camera_map) @ earlier.T_keyframe_camera
    A_b, A_earlier = se3.adjoint(T_current_b), se3.adjoint(T_current_earlier)
    apart_s = abs(current.stamp - earlier.stamp) * 1e-9
    inflation = 1.0 + TUNING.shared_error * (1.0 - np.exp(-apart_s / TUNING.shared_error_s))
    ends = current.covariance + A_earlier @ earlier.covariance @ A_earlier.T
    common = common_covariance(se3.inverse(T_current_earlier), calibration_error)
    if earlier.twist is not None and current.twist is not None:
        common += delay_covariance(A_earlier, earlier.twist, current.twist, delay_variance)
    known_error = se3.log(T_current_earlier @ T_earlier_current)
    common += known_error[:, None] * known_error
    return np.asarray(inflation * ends + A_b @ between @ A_b.T + common)


def covariance_since_start(keyframes: list[Keyframe], frame: LoggedFrame, calibration_error: float) -> Array | None:
    """Return the 6 x 6 covariance (`se3`, camera frame) of a pose since its segment began, None where LOST."""
    if frame.keyframe is None or frame.T_keyframe_camera is None or frame.covariance is None:
        return None
    keyframe = keyframes[frame.keyframe]
    T_first_keyframe = keyframes[keyframe.first].T_camera_map @ se3.inverse(keyframe.T_camera_map)
    T_first_camera = T_first_keyframe @ frame.T_keyframe_camera
    own = independent_covariance(frame.covariance) + common_covariance(T_first_camera, calibration_error)
    return se3.compose_covariance(keyframe.covariance_since_start, frame.T_keyframe_camera, own)
