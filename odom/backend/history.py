"""Frames between key frames: covariances of the motions between them, and the trajectory that moves with the map."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from odom.backend.estimate import RelativePose, TrajectoryPose
from odom.backend.keyframes import Keyframe
from odom.backend.map import Map
from odom.backend.placed import Placed
from odom.frame import Stamp
from odom.registration import se3

Array = NDArray[np.float64]

_SHARED, _SHARED_S = 0.8, 0.5
"""Errors that frames share (the landmarks', the calibration's) against a frame's own: ratio of variances, and the time
over which the camera looks elsewhere and they part. Measured on real and simulated walks alike."""
_LONGEST_GAP_S = 0.2


def long_after(covariance: Array) -> Array:
    """Return a frame's own `covariance` against what was seen long ago, with which it shares no errors any more."""
    return (1.0 + _SHARED) * covariance


def wrong_calibration(T_earlier_current: Array, calibration_error: float) -> Array:
    """Return the 6 x 6 covariance of a motion of which a wrong calibration adds or hides that share.

    A focal length that is off takes rotation for translation, at a scene depth of about a metre.
    """
    moved = calibration_error * se3.log(T_earlier_current)
    return np.asarray(float(moved @ moved) * np.eye(6))


def relative_covariance(map_: Map, earlier: Placed, current: Placed, calibration_error: float) -> Array | None:
    """Return the 6 x 6 covariance (`se3`, current camera frame) of T_earlier_current, None over a loss or segments.

    Each frame's own error is white; the errors that frames share part exponentially with time (Ornstein-Uhlenbeck).
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
    apart_s = (current.stamp - earlier.stamp) * 1e-9
    parted = 1.0 + _SHARED * (1.0 - np.exp(-apart_s / _SHARED_S))
    ends = current.covariance + A_earlier @ earlier.covariance @ A_earlier.T
    calibration = wrong_calibration(se3.inverse(T_current_earlier), calibration_error)
    return np.asarray(parted * ends + A_b @ between @ A_b.T + calibration)


def covariance_since_start(keyframes: list[Keyframe], placed: Placed, calibration_error: float) -> Array | None:
    """Return the 6 x 6 covariance (`se3`, camera frame) of a pose since its segment began, None where LOST."""
    if placed.keyframe is None or placed.T_keyframe_camera is None or placed.covariance is None:
        return None
    keyframe = keyframes[placed.keyframe]
    T_first_keyframe = keyframes[keyframe.first].T_camera_map @ se3.inverse(keyframe.T_camera_map)
    T_first_camera = T_first_keyframe @ placed.T_keyframe_camera
    own = long_after(placed.covariance) + wrong_calibration(T_first_camera, calibration_error)
    return se3.compose_covariance(keyframe.covariance_since_start, placed.T_keyframe_camera, own)


def relative_pose(
    T_odom_earlier: Array, T_odom_current: Array, covariance: Array | None, stamp_earlier: Stamp, inliers: int
) -> RelativePose | None:
    """Return the published motion since `stamp_earlier`, None where its covariance is not known."""
    if covariance is None:
        return None
    return RelativePose(stamp_earlier, se3.inverse(T_odom_earlier) @ T_odom_current, covariance, inliers)


@dataclass(frozen=True, eq=False)
class _Middle:
    """A frame and its pose in the map (None: LOST) at its middle row's time."""

    placed: Placed
    T_map_camera: Array | None
    segment: int

    @classmethod
    def of(cls, placed: Placed, keyframes: list[Keyframe]) -> "_Middle":
        if placed.keyframe is None or placed.T_keyframe_camera is None:
            return cls(placed, None, placed.segment)
        keyframe = keyframes[placed.keyframe]
        return cls(placed, se3.inverse(keyframe.T_camera_map) @ placed.T_keyframe_camera, keyframe.segment)


def trajectory(frames: Iterable[Placed], keyframes: list[Keyframe]) -> tuple[TrajectoryPose, ...]:
    """Return every frame's pose at its stamp: carried from the middle row's time along the motion to the next frame."""
    middles = chain([None], (_Middle.of(placed, keyframes) for placed in frames), [None])
    around = pairwise(pairwise(middles))
    return tuple(_at_stamp(here, before, after) for (before, here), (_, after) in around if here is not None)


def _at_stamp(here: _Middle, before: _Middle | None, after: _Middle | None) -> TrajectoryPose:
    f, T = here.placed, here.T_map_camera
    T_stamp = T
    for there, sign in ((after, 1.0), (before, -1.0)):
        if T is None or not f.delay_s or there is None or there.segment != here.segment:
            continue
        apart_s = abs(there.placed.since_s(f))
        if there.T_map_camera is not None and 0.0 < apart_s < _LONGEST_GAP_S:
            T_stamp = T @ se3.exp(sign * f.delay_s / apart_s * se3.log(se3.inverse(T) @ there.T_map_camera))
            break
    return TrajectoryPose(f.stamp, T_stamp, here.segment)
