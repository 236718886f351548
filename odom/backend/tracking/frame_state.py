"""The newest frame with a pose: where the camera was, how it moved, and what it saw."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from odom.backend.map.keyframe import Keyframe, MeasuredLandmarks
from odom.backend.map.landmarks import Landmarks
from odom.backend.map.map import Map
from odom.backend.tracking.expected_pose import ExpectedPose
from odom.backend.tracking.motion_model import ANY_VELOCITY, AT_REST, Motion, Velocity, is_plausible_motion
from odom.backend.tracking.pose_solver import fit_pose
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.lens_change import LensChange
from odom.frontend.features.measurement import Measurements
from odom.frontend.features.view import View
from odom.frontend.matching.line_of_sight import LineOfSight
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class Tracked:
    """A frame's pose `T_camera_map` for its middle row, with the information of the fit (6 x 6, camera frame).

    `rows` (n) are the landmarks found, at `uv` (n x 2 px), with their `measurements`, `chi2` (n x 2: ray, depth) and
    `inliers` (n); `looked_for` are the rows of all that were, `missed` those of them that are no inliers, with the line
    of `sight` to each; those found `elsewhere` seem to have moved. `reference` is the key frame nearest in
    pose, `twist` (6, SI, camera frame) the velocity that the measurements were carried with; where the rows of the
    image showed it, `twist_covariance` (6 x 6) is its covariance, else None.
    """

    T_camera_map: Array
    information: Array
    rows: Index
    uv: Array
    measurements: Measurements
    chi2: Array
    inliers: Mask
    looked_for: Index
    missed: Index
    elsewhere: Index
    sight: LineOfSight
    reference: int
    twist: Array
    twist_covariance: Array | None

    @property
    def velocity(self) -> Velocity:
        """The velocity that the rows of the image showed; any, where they showed none."""
        return ANY_VELOCITY if self.twist_covariance is None else Velocity(self.twist, self.twist_covariance)

    @cached_property
    def T_map_camera(self) -> Array:
        """The pose the other way round."""
        return se3.inverse(self.T_camera_map)

    @cached_property
    def inlier_landmarks(self) -> MeasuredLandmarks:
        """The landmarks found where the pose predicts them."""
        return self._measured(self.inliers)

    @property
    def is_contested(self) -> bool:
        """Whether so many landmarks seem to have moved that they may be the scene's."""
        return len(self.elsewhere) >= max(TUNING.contested_least, TUNING.contested_share * self.inlier_count)

    @property
    def displaced(self) -> MeasuredLandmarks:
        """The landmarks found near where the pose predicts them, but not there."""
        return self._measured(~self.inliers & (self.chi2[:, 0] < TUNING.displaced_chi2))

    def _measured(self, chosen: Mask) -> MeasuredLandmarks:
        rows = np.flatnonzero(chosen)
        return MeasuredLandmarks(self.rows.take(rows), self.uv.take(rows, 0), self.measurements.take(rows))

    @cached_property
    def inlier_count(self) -> int:
        """How many landmarks were found where the pose predicts them."""
        return int(np.count_nonzero(self.inliers))

    @property
    def found_again(self) -> int:
        """How many landmarks were found where the pose predicts them, at the predicted depth where it was measured."""
        return int(np.count_nonzero(self.inliers & (self.chi2[:, 1] < TUNING.inlier_chi2)))

    @property
    def visible_count(self) -> int:
        """How many landmarks were looked for, without those hidden by something nearer: half of them at most."""
        return len(self.looked_for) - min(int(np.count_nonzero(self.sight.hidden)), len(self.looked_for) // 2)

    @cached_property
    def covariance(self) -> Array:
        """The pose's 6 x 6 covariance (`se3`, camera frame) that follows from those of the measurements."""
        return np.asarray(np.linalg.inv(self.information), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class MotionPrior:
    """The camera's `motion` in the map `since_s` seconds ago, and the `expected_pose` that it leads to by now.

    `scale` multiplies the covariances of measurements. Without `expected_pose`, where the pose was not predicted by
    motion, no other poses are tried. `are_bent`: the landmarks were measured as if at rest, so that the rolling shutter
    has bent them as it bends this frame, whose rows then do not show its velocity.
    """

    motion: Motion
    since_s: float
    scale: float
    expected_pose: ExpectedPose | None = None
    are_bent: bool = False

    def mean_twist_to(self, T_camera_map: Array) -> Array:
        """Return the mean velocity (6, SI, the camera's own frame) that led to the pose `T_camera_map`."""
        return np.asarray(-se3.log(T_camera_map @ self.motion.T_fixed_camera) / self.since_s)


@dataclass(frozen=True, eq=False)
class FrameState:
    """The newest frame that was tracked or began a segment (`tracked` is None), and the camera's motion there.

    `T_camera_map` and `twist` (6, SI, camera frame) are those of its middle row, near key frame `reference`. The next
    frame is followed from the landmarks `rows` (n), which this one showed at `uv` (n x 2 px). `is_bridged`: frames
    since could not be tracked, and a prediction stood in for them. `is_bent`: what it saw was measured as if at rest,
    since its motion was not known; the rolling shutter has bent it. `begun_stamp`: when its segment began, None where
    that was before the odometry did.
    """

    view: View
    tracked: Tracked | None
    T_camera_map: Array
    twist: Array
    reference: int
    rows: Index
    uv: Array
    begun_stamp: SteadyStamp | None = None
    is_bridged: bool = False
    is_bent: bool = False

    @classmethod
    def at_beginning(cls, view: View, T_camera_map: Array, keyframe: Keyframe) -> "FrameState":
        """Return the state of the frame that began a segment as its first `keyframe`."""
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
        step = -se3.log(T_camera_map @ self.T_map_camera)
        return np.asarray(step / since_s) if since_s > 0.0 and is_plausible_motion(step / since_s) else self.twist

    def step_to(self, tracked: Tracked) -> Array:
        """Return the motion (6, `se3`) from this frame's pose to a tracked one's, as a change of T_camera_map."""
        return se3.log(tracked.T_camera_map @ self.T_map_camera)

    def motion_to(self, tracked: Tracked, map_: Map) -> Array | None:
        """Return T_here_tracked as the map has it, None where the two are in segments that were never joined."""
        a, b = map_.keyframes[self.reference], map_.keyframes[tracked.reference]
        return self.T_camera_map @ tracked.T_map_camera if a.segment == b.segment else None

    def predicted_after(self, since_s: float) -> Array:
        """Return T_camera_map `since_s` seconds later by constant velocity."""
        return np.asarray(se3.exp(-self.twist * since_s) @ self.T_camera_map)

    def expected_after(self, since_s: float) -> ExpectedPose:
        """Return where the camera is expected `since_s` seconds later.

        Shortly after its segment began, it may have followed a body ever since: its pose is as unsure as its velocity.
        """
        if self.tracked is None:
            return ExpectedPose.at_unknown_velocity(self.T_camera_map, since_s)
        expected = ExpectedPose.after(self.predicted_after(since_s), since_s)
        age_s = math.inf if self.begun_stamp is None else -self.since_s(self.begun_stamp)
        return expected.with_unknown_velocity(age_s) if 0.0 <= age_s < TUNING.young_s else expected

    def motion_prior(self, since_s: float, scale: float) -> MotionPrior:
        """Return the camera's motion here, `since_s` seconds ago; `scale` is the sensor's covariance scale."""
        motion = Motion.of(self.T_map_camera, np.zeros((6, 6)))
        if self.tracked is not None:
            motion = Motion.of(motion.T_fixed_camera, self.tracked.covariance * scale, self.tracked.velocity)
        return MotionPrior(motion, since_s, scale, self.expected_after(since_s), self.is_bent)

    def seen_through(self, change: LensChange, timing_change: Array, landmarks: Landmarks) -> "FrameState":
        """Return this state as measured through a new lens, its pose fitted to the `landmarks` of that lens.

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

    def at_pose(self, T_camera_map: Array) -> "FrameState":
        """Return this state at another pose."""
        tracked = None if self.tracked is None else replace(self.tracked, T_camera_map=T_camera_map)
        return replace(self, T_camera_map=T_camera_map, tracked=tracked)

    def moved_with(self, map_: Map, T_reference_camera: Array) -> "FrameState":
        """Return this state after the map has moved: its pose relative to the reference key frame stays the same."""
        return self.at_pose(se3.inverse(T_reference_camera) @ map_.keyframes[self.reference].T_camera_map)
