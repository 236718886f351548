"""A camera followed by the surfaces of its depth images, where colour shows too little to track it by."""

import math
from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.frame_log import FrameLog
from odom.backend.map.map import Map
from odom.backend.odometry.tuning import TUNING
from odom.backend.tracking.motion_model import ANY_VELOCITY, Motion, ProcessNoise, Velocity, is_plausible_motion
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frame import Stamp
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.surface import Surfaces
from odom.frontend.features.view import View
from odom.frontend.matching.surface_alignment import align_surfaces
from odom.geometry import se3
from odom.geometry.arrays import Array

_PROCESS_NOISE = ProcessNoise(TUNING.surface_acceleration_m_s2, TUNING.surface_acceleration_rad_s2)
"""How quickly the velocity of a camera changes that surfaces follow."""
_VELOCITY_SIGMA = np.repeat([_PROCESS_NOISE.linear, _PROCESS_NOISE.angular], 3) * _PROCESS_NOISE.steady_s
"""One sigma of a velocity (6, m/s and rad/s) that is the mean over the last frame."""


@dataclass(frozen=True, eq=False)
class SurfaceFollowing:
    """Where the camera went after the last frame that landmarks placed.

    Views are aligned with the surfaces of an `anchor`: of that frame, then of newer ones where too little of it is left
    in view. `T_placed_anchor` leads there, and `covariance_anchor` (6 x 6) is that of the anchor's pose in the map.
    `motion` is the camera's in the anchor's frame at the middle row of the frame of `stamp`, which is really from
    `steady_stamp`; at `held_stamp`, surfaces held it in all directions for the last time. The frames followed are those
    in the log from number `first` on. `best_misfit` is the smallest so far: how much noisier than known the sensor is.
    """

    anchor: Surfaces
    T_placed_anchor: Array
    covariance_anchor: Array
    motion: Motion
    stamp: Stamp
    steady_stamp: SteadyStamp
    held_stamp: SteadyStamp
    first: int
    best_misfit: float = math.inf

    @classmethod
    def begun(cls, placed: PosedFrame, sensor: SensorModel, first: int) -> "SurfaceFollowing":
        """Return what is known at a frame that landmarks `placed`; frame number `first` will be followed from there."""
        anchor = Surfaces.of(placed.view, sensor, placed.twist)
        covariance, velocity = np.zeros((6, 6)), ANY_VELOCITY
        if placed.tracked is not None:
            covariance = placed.tracked.covariance * sensor.noise.covariance_scale
            velocity = Velocity(placed.twist, np.diag(_VELOCITY_SIGMA**2))
        motion, view = Motion.of(np.eye(4), np.zeros((6, 6)), velocity), placed.view
        return cls(anchor, np.eye(4), covariance, motion, view.stamp, view.steady_stamp, view.steady_stamp, first)

    def after(self, view: View, sensor: SensorModel, longest_s: float) -> "SurfaceFollowing | None":
        """Return where the camera went until `view`.

        None where surfaces have not held it in all directions for longer than `longest_s` (till then, its motion is
        predicted in those that have no shape), or where no camera moves so.
        """
        predicted = self.motion.after(self.since_s(view), _PROCESS_NOISE)
        surfaces = Surfaces.of(view, sensor, predicted.twist)
        aligned = align_surfaces(surfaces, self.anchor, predicted.T_fixed_camera, predicted.covariance)
        is_same = aligned.overlap >= TUNING.surface_least_overlap and aligned.in_front <= TUNING.surface_most_in_front
        best_misfit = min(aligned.misfit, self.best_misfit) if is_same else self.best_misfit
        is_seen = is_same and aligned.misfit <= TUNING.surface_most_misfit * max(1.0, best_misfit)
        motion = predicted.corrected(aligned.T_target_source, aligned.covariance) if is_seen else predicted
        held_stamp = view.steady_stamp if is_seen and aligned.has_shape else self.held_stamp
        if (view.steady_stamp - held_stamp) * 1e-9 > longest_s or not is_plausible_motion(motion.twist):
            return None
        moved = replace(
            self,
            motion=motion,
            stamp=view.stamp,
            steady_stamp=view.steady_stamp,
            held_stamp=held_stamp,
            best_misfit=best_misfit,
        )
        is_worn = held_stamp == view.steady_stamp and aligned.overlap < TUNING.surface_enough_overlap
        return moved._anchored(surfaces) if is_worn else moved

    def since_s(self, view: View) -> float:
        """Return how much later `view` is, in seconds."""
        return (view.steady_stamp - self.steady_stamp) * 1e-9

    def _anchored(self, surfaces: Surfaces) -> "SurfaceFollowing":
        """Return the same with the newest view, which shows `surfaces`, as the anchor."""
        velocity = Velocity(self.motion.twist, self.motion.P[6:, 6:])
        return replace(
            self,
            anchor=surfaces,
            T_placed_anchor=self.T_placed_camera,
            covariance_anchor=self.covariance,
            motion=Motion.of(np.eye(4), np.zeros((6, 6)), velocity),
        )

    def pose_after(self, placed: PosedFrame) -> tuple[Array, tuple[int, Array]]:
        """Return T_camera_map by that of the frame that landmarks `placed`, and what it is known against.

        That is a key frame's number, with the pose's 6 x 6 covariance (`se3`, camera frame) against it.
        """
        return se3.inverse(self.T_placed_camera) @ placed.T_camera_map, (placed.reference, self.covariance)

    @property
    def T_placed_camera(self) -> Array:
        """The motion since the frame that landmarks placed."""
        return np.asarray(self.T_placed_anchor @ self.motion.T_fixed_camera)

    @property
    def covariance(self) -> Array:
        """The 6 x 6 covariance (`se3`, camera frame) of the pose in the map."""
        return se3.compose_covariance(self.covariance_anchor, self.motion.T_fixed_camera, self.motion.covariance)

    def T_placed_after(self, delay_s: float) -> Array:
        """Return the motion from the frame that landmarks placed to `delay_s` seconds after this one."""
        return np.asarray(self.T_placed_camera @ se3.exp(self.motion.twist * delay_s))


def distribute_drift(
    log: FrameLog, map_: Map, following: SurfaceFollowing, placed: PosedFrame, view: View, found: TrackedFrame
) -> None:
    """Move the followed frames in the `log` so that they lead to where landmarks have `found` the camera at `view`.

    The error that shows there has grown evenly since the frame that landmarks had `placed`. Where the two are in
    different segments, nothing is known of it.
    """
    if map_.keyframes[placed.reference].segment != map_.keyframes[found.reference].segment:
        return
    T_placed_led = following.T_placed_after(following.since_s(view))
    error = se3.log(placed.T_camera_map @ found.T_map_camera @ se3.inverse(T_placed_led))
    for number in range(max(following.first, log.dropped), log.count):
        frame = log[number]
        if frame.keyframe is None or frame.T_keyframe_camera is None:
            continue
        share = (frame.stamp - placed.view.stamp) / (view.stamp - placed.view.stamp)
        T_placed_keyframe = placed.T_camera_map @ se3.inverse(map_.keyframes[frame.keyframe].T_camera_map)
        T_keyframe_moved = se3.inverse(T_placed_keyframe) @ se3.exp(share * error) @ T_placed_keyframe
        log.move(number, T_keyframe_moved @ frame.T_keyframe_camera)
