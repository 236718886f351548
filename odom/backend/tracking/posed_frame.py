"""The newest frame with a pose: where the camera was, how it moved, and what it saw."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from odom.backend.map.keyframe import Keyframe
from odom.backend.map.landmarks import Landmarks
from odom.backend.map.map import Map
from odom.backend.tracking.expected_pose import ExpectedPose, MotionPrior
from odom.backend.tracking.motion_model import AT_REST, Motion, is_plausible_motion, mean_twist
from odom.backend.tracking.pose_solver import fit_pose
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.lens_change import LensChange
from odom.frontend.features.view import View
from odom.geometry import se3
from odom.geometry.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class PosedFrame:
    """The newest frame that was tracked or began a segment (`tracked` is None), and the camera's motion there.

    `T_camera_map` and `twist` (6, SI, camera frame) are those of its middle row, near key frame `reference`. The next
    frame is followed from the landmarks `rows` (n), which this one showed at `uv` (n x 2 px). `is_bridged`: frames
    since could not be tracked, and a prediction stood in for them. `is_bent`: what it saw was measured as if at rest,
    since its motion was not known; the rolling shutter has bent it. `begun_stamp`: when its segment began, None where
    that was before the odometry did.
    """

    view: View
    tracked: TrackedFrame | None
    T_camera_map: Array
    twist: Array
    reference: int
    rows: Index
    uv: Array
    begun_stamp: SteadyStamp | None = None
    is_bridged: bool = False
    is_bent: bool = False

    @classmethod
    def at_beginning(cls, view: View, T_camera_map: Array, keyframe: Keyframe) -> "PosedFrame":
        """Return the frame that began a segment as its first `keyframe`."""
        number, rows, uv = keyframe.number, keyframe.rows, keyframe.uv
        return cls(view, None, T_camera_map, AT_REST, number, rows, uv, view.steady_stamp, is_bent=True)

    def since_s(self, stamp: SteadyStamp) -> float:
        """Return the time from this frame to `stamp`, in seconds."""
        return (stamp - self.view.steady_stamp) * 1e-9

    @cached_property
    def T_map_camera(self) -> Array:
        """The pose the other way round."""
        return se3.inverse(self.T_camera_map)

    def twist_to(self, T_camera_map: Array, since_s: float) -> Array:
        """Return the mean velocity (6, SI, camera frame) that led to the pose `T_camera_map` in `since_s` seconds.

        It is zero after a bent frame, since the next one is bent alike, and this frame's `twist` where no camera could
        have moved so.
        """
        if self.is_bent:
            return AT_REST
        if since_s <= 0.0:
            return self.twist
        twist = mean_twist(self.T_map_camera, T_camera_map, since_s)
        return twist if is_plausible_motion(twist) else self.twist

    def step_to(self, tracked: TrackedFrame) -> Array:
        """Return the motion (6, `se3`) from this frame's pose to a tracked one's, as a change of T_camera_map."""
        return se3.log(tracked.T_camera_map @ self.T_map_camera)

    def motion_to(self, tracked: TrackedFrame, map_: Map) -> Array | None:
        """Return T_here_tracked as the map has it, None where the two are in segments that were never joined."""
        a, b = map_.keyframes[self.reference], map_.keyframes[tracked.reference]
        return self.T_camera_map @ tracked.T_map_camera if a.segment == b.segment else None

    def predicted_after(self, since_s: float) -> Array:
        """Return T_camera_map `since_s` seconds later by constant velocity."""
        return np.asarray(se3.exp(-self.twist * since_s) @ self.T_camera_map)

    def expected_after(self, since_s: float) -> ExpectedPose:
        """Return where the camera is expected `since_s` seconds later.

        Shortly after its segment began, it may have followed a body ever since, and so it may as long as many features
        have disagreed: its pose is as unsure as if its velocity had not been known for that time.
        """
        if self.tracked is None:
            return ExpectedPose.at_unknown_velocity(self.T_camera_map, since_s)
        expected = ExpectedPose.after(self.predicted_after(since_s), since_s)
        age_s = math.inf if self.begun_stamp is None else -self.since_s(self.begun_stamp)
        unknown_s = age_s if 0.0 <= age_s < TUNING.young_s else 0.0
        if self.tracked.disputed_since is not None:
            unknown_s = max(unknown_s, since_s - self.since_s(self.tracked.disputed_since))
        return expected.with_unknown_velocity(unknown_s)

    def motion_prior(self, since_s: float, scale: float) -> MotionPrior:
        """Return the camera's motion here, `since_s` seconds ago; `scale` is the sensor's covariance scale."""
        motion, disputed_since = Motion.of(self.T_map_camera, np.zeros((6, 6))), None
        if self.tracked is not None:
            motion = Motion.of(motion.T_fixed_camera, self.tracked.covariance * scale, self.tracked.velocity)
            disputed_since = self.tracked.disputed_since
        return MotionPrior(motion, since_s, scale, self.expected_after(since_s), self.is_bent, disputed_since)

    def with_lens_changed(self, change: LensChange, timing_change: Array, landmarks: Landmarks) -> "PosedFrame":
        """Return this frame as measured through a new lens, its pose fitted to the `landmarks` of that lens.

        The timing's vector changed by `timing_change` (3, s) with the lens.
        """
        tracked = self.tracked
        if tracked is None:
            return self
        measured, rows = change.measured(tracked.measurements).retimed(timing_change), tracked.rows
        used = tracked.inliers & landmarks.alive[rows]
        points, covariances = landmarks.position[rows], landmarks.covariance[rows]
        T = fit_pose(points, covariances, measured.values, measured.covariance, self.T_camera_map, used).T_camera_map
        return replace(self, tracked=replace(tracked, measurements=measured)).at_pose(T)

    def T_reference_camera(self, map_: Map) -> Array:
        """Return the pose relative to the reference key frame."""
        return np.asarray(map_.keyframes[self.reference].T_camera_map @ self.T_map_camera)

    def at_pose(self, T_camera_map: Array) -> "PosedFrame":
        """Return this frame at another pose."""
        tracked = None if self.tracked is None else replace(self.tracked, T_camera_map=T_camera_map)
        return replace(self, T_camera_map=T_camera_map, tracked=tracked)

    def moved_with(self, map_: Map, T_reference_camera: Array) -> "PosedFrame":
        """Return this frame after the map has moved: its pose relative to the reference key frame stays the same."""
        return self.at_pose(se3.inverse(T_reference_camera) @ map_.keyframes[self.reference].T_camera_map)
