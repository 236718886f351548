"""What is known of a frame's pose beforehand: how the camera moved, and how far a hand may have jerked it since."""

from dataclasses import dataclass

import numpy as np

from odom.backend.tracking.motion_model import Motion
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.geometry import se3
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class ExpectedPose:
    """Where a frame's pose `T_camera_map` is expected, and how far a jerk may take it away: `free` (m, rad)."""

    T_camera_map: Array
    free: Array

    @classmethod
    def after(cls, T_camera_map: Array, since_s: float) -> "ExpectedPose":
        """Return the pose predicted by constant velocity over `since_s` seconds.

        Over less than `acceleration_least_s` what poses err by takes it as far away as a jerk over that time.
        """
        since_s = max(since_s, TUNING.acceleration_least_s)
        return cls(T_camera_map, np.array([TUNING.jerk_m_s2, TUNING.jerk_rad_s2]) * since_s**2)

    @classmethod
    def at_unknown_velocity(cls, T_camera_map: Array, since_s: float) -> "ExpectedPose":
        """Return what is expected of a camera that was at a pose `since_s` seconds ago, its velocity unknown."""
        return cls(T_camera_map, np.zeros(2)).with_unknown_velocity(since_s)

    def with_unknown_velocity(self, since_s: float) -> "ExpectedPose":
        """Return the same pose where the velocity was not known for `since_s` seconds before it."""
        away = np.array([TUNING.velocity_sigma_m_s, TUNING.velocity_sigma_rad_s]) * since_s
        return ExpectedPose(self.T_camera_map, self.free + away)

    def is_within_reach(self, T_camera_map: Array) -> bool:
        """Return whether a hand-held camera could have reached a pose without being knocked."""
        away = np.linalg.norm(se3.log(T_camera_map @ se3.inverse(self.T_camera_map)).reshape(2, 3), axis=1)
        return bool(np.linalg.norm(away / self.free) < TUNING.reach_in_doubt)


@dataclass(frozen=True, eq=False)
class MotionPrior:
    """The camera's `motion` in the map `since_s` seconds ago, and the `expected_pose` that it leads to by now.

    `scale` multiplies the covariances of measurements. Without `expected_pose`, where the pose was not predicted by
    motion, no other poses are tried. `are_bent`: the landmarks were measured as if at rest, so that the rolling shutter
    has bent them as it bends this frame, whose rows then do not show its velocity. `disputed_since`: from when on many
    features have disagreed with the pose in every frame up to then, None where few did.
    """

    motion: Motion
    since_s: float
    scale: float
    expected_pose: ExpectedPose | None = None
    are_bent: bool = False
    disputed_since: SteadyStamp | None = None
