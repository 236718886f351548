"""The final trajectory: every frame's pose at its stamp, moved with the map as it was adjusted, and smoothed."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np

from odom.backend.estimate import TrajectoryPose
from odom.backend.map.frame_log import LoggedFrame
from odom.backend.map.keyframe import Keyframe
from odom.backend.odometry.smoothing import smoothed
from odom.backend.odometry.tuning import TUNING
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class _Middle:
    """A frame and its pose in the map at its middle row's time (None: LOST)."""

    frame: LoggedFrame
    T_map_camera: Array | None
    segment: int

    @classmethod
    def of(cls, frame: LoggedFrame, keyframes: list[Keyframe]) -> "_Middle":
        if frame.keyframe is None or frame.T_keyframe_camera is None:
            return cls(frame, None, frame.segment)
        keyframe = keyframes[frame.keyframe]
        return cls(frame, se3.inverse(keyframe.T_camera_map) @ frame.T_keyframe_camera, keyframe.segment)


def trajectory(
    frames: Iterable[LoggedFrame], keyframes: list[Keyframe], timing: ShutterTiming
) -> tuple[TrajectoryPose, ...]:
    """Return every frame's pose at its stamp, as a shutter of that `timing` has it, with smoothed positions."""
    variances: list[float] = []

    def noted() -> Iterator[LoggedFrame]:
        for frame in frames:
            variances.append(frame.position_variance)
            yield frame

    poses = at_stamps(noted(), keyframes, timing)
    return smoothed(poses, np.array(variances))


def at_stamps(
    frames: Iterable[LoggedFrame], keyframes: list[Keyframe], timing: ShutterTiming
) -> tuple[TrajectoryPose, ...]:
    """Return every frame's pose at its stamp: carried from the middle row's time along the motion to the next frame.

    Where there is no next one, it is carried by the motion from the frame before; where both are so far apart that the
    camera may have turned back in between, by the frame's own velocity.
    """
    middles = chain([None], (_Middle.of(frame, keyframes) for frame in frames), [None])
    around = pairwise(pairwise(middles))
    return tuple(_at_stamp(here, before, after, timing) for (before, here), (_, after) in around if here is not None)


def _at_stamp(here: _Middle, before: _Middle | None, after: _Middle | None, timing: ShutterTiming) -> TrajectoryPose:
    frame, T = here.frame, here.T_map_camera
    delay_s = frame.delay_s(timing)
    if T is None or not delay_s:
        return TrajectoryPose(frame.stamp, T, here.segment)
    twist = frame.twist
    for there, sign in ((after, 1.0), (before, -1.0)):
        if there is None or there.T_map_camera is None or there.segment != here.segment:
            continue
        apart_s = abs(there.frame.since_s(frame, timing))
        if 0.0 < apart_s < TUNING.longest_gap_s:
            twist = sign / apart_s * se3.log(se3.inverse(T) @ there.T_map_camera)
            break
    T_stamp = T if twist is None else T @ se3.exp(delay_s * twist)
    return TrajectoryPose(frame.stamp, T_stamp, here.segment)
