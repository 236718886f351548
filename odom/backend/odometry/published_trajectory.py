"""The causal trajectory: what is published of each frame, at once and for good, with covariances of its motions."""

from dataclasses import replace

import numpy as np

from odom.backend.doubt import Doubt
from odom.backend.estimate import RelativePose
from odom.backend.map.frame_log import FrameLog, LoggedFrame
from odom.backend.map.keyframe import Keyframe
from odom.backend.map.map import Map
from odom.backend.odometry.judged_frame import JudgedFrame
from odom.backend.odometry.motion_covariance import covariance_of_motion, covariance_of_pose
from odom.backend.odometry.moving_view import MovingView
from odom.backend.odometry.odom_in_map import OdomInMap, Origin
from odom.backend.odometry.recently_published import RecentlyPublished
from odom.backend.odometry.surface_following import SurfaceFollowing
from odom.backend.odometry.tuning import TUNING
from odom.backend.published_pose import PublishedPose
from odom.backend.tracking.motion_model import Motion, MotionFilter, ProcessNoise, Velocity
from odom.backend.tracking.posed_frame import PosedFrame
from odom.frame import Stamp
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.view import View
from odom.geometry import se3
from odom.geometry.arrays import Array


class PublishedTrajectory:
    """The `log` of all frames (poses at the middle row's time) and the poses published last.

    The map grows and moves meanwhile: `T_map_odom` takes up the corrections, so that published poses are continuous.
    These do not become surer by a correction: from the last pose published before it on, their covariance only grows.
    """

    def __init__(self, map_: Map) -> None:
        self.log = FrameLog()
        self._odom = OdomInMap()
        self._map = map_
        self._recent = RecentlyPublished()
        self._newest: PublishedPose | None = None
        self._corrected: PublishedPose | None = None
        self._filter: MotionFilter | None = None

    @property
    def T_map_odom(self) -> Array:
        """Where odom lies in the map."""
        return self._odom.T_map_odom

    def correct(self, T_new_old: Array) -> None:
        """Keep odom continuous: a closure has moved the map around the camera by `T_new_old`."""
        self._odom.correct(T_new_old)
        self._corrected = self._newest

    def change_lens(self, T_new_old: Array) -> None:
        """Keep odom continuous where a better lens has moved the map around the camera by `T_new_old`."""
        self._odom.change_lens(T_new_old)
        self._corrected = self._newest

    def begin(self, view: View, keyframe: Keyframe, sensor: SensorModel, twist: Array | None = None) -> PublishedPose:
        """Publish the first frame of a segment, which became `keyframe`.

        Where its `twist` (6, SI, camera frame) is not known yet, its pose begins odom anew (see `Origin`).
        """
        pose = keyframe.number, np.eye(4), np.zeros((6, 6))
        self.log.append(LoggedFrame(view.stamp, keyframe.segment, view.late_s, *pose))
        self._recent.clear()
        T_middle_stamp, T_odom_camera = np.eye(4), self._odom.pose(se3.inverse(keyframe.T_camera_map))
        self._filter = MotionFilter.begun(T_odom_camera, pose[2], self._process_noise)
        if twist is None:
            self._odom.origin = Origin(keyframe.segment, T_odom_camera, view.late_s)
        else:
            T_middle_stamp = se3.exp(view.since_middle_s(sensor.timing) * twist)
            T_odom_camera, self._odom.origin = T_odom_camera @ T_middle_stamp, None
        frame = LoggedFrame(view.stamp, keyframe.segment, None, keyframe.number, T_middle_stamp, pose[2], twist=twist)
        doubt = Doubt() if self._newest is None else self._newest.doubt.known_again()
        since_start = self._since_start(frame, T_odom_camera, doubt, sensor)
        return self._keep(PublishedPose(frame, T_odom_camera, since_start, T_middle_stamp, doubt=doubt))

    def advance(self, judged: JudgedFrame, moving: MovingView, sensor: SensorModel) -> PublishedPose:
        """Publish a judged frame, whose pose is that at its middle row's time; `moving` is what moves in its view.

        The pose is smoothed and carried to the stamp. Since the image's time is known to the clock's sigma only, the
        distance that the camera covers in that time adds to the covariance.
        """
        view, reference = judged.view, self._map.keyframes[judged.tracked.reference]
        delay_s = view.since_middle_s(sensor.timing)
        T_reference_middle = reference.T_camera_map @ judged.tracked.T_map_camera
        middle = LoggedFrame(view.stamp, reference.segment, view.late_s, reference.number, T_reference_middle)
        self.log.append(replace(middle, covariance=judged.covariance, twist=judged.twist))
        last = None if self._recent.last is None else self._recent.last.frame
        if last is not None and last.keyframe is not None:
            is_joined = self._map.keyframes[last.keyframe].segment == middle.segment
            if not is_joined or view.stamp <= last.stamp:
                self._recent.clear()
        T_odom_last = None if self._newest is None else self._newest.T_odom_camera
        T_odom_middle = self._odom.next_pose(judged.tracked.T_map_camera, T_odom_last)
        motion = self._filtered(T_odom_middle, judged)
        T_fitted_filtered = se3.inverse(T_odom_middle) @ motion.T_fixed_camera
        motion = self._move_origin(motion, judged, sensor)
        carried = motion.after(delay_s, self._process_noise)
        T_odom_stamp = carried.T_fixed_camera
        T_middle_stamp = se3.inverse(motion.T_fixed_camera) @ T_odom_stamp
        frame = replace(
            middle,
            T_keyframe_camera=T_reference_middle @ T_fitted_filtered @ T_middle_stamp,
            covariance=carried.covariance + motion.twist[:, None] * motion.twist * sensor.clock.sigma_s**2,
            late_s=None,
            twist=motion.twist,
        )
        doubt = self._doubt(T_odom_stamp, judged, moving)
        current = PublishedPose(
            frame=frame,
            T_odom_camera=T_odom_stamp,
            covariance=self._since_start(frame, T_odom_stamp, doubt, sensor),
            T_middle_stamp=T_middle_stamp,
            covariance_middle_stamp=motion.covariance_of_going(delay_s),
            doubt=doubt,
        )
        return self._keep(self._with_motions(current, judged, sensor))

    def _filtered(self, T_odom_middle: Array, judged: JudgedFrame) -> Motion:
        """Return the filtered motion at a judged frame's middle row.

        The filter begins anew where no motion led there, or where the pose is far beyond what the motion predicts: the
        recording was cut.
        """
        measured, since_s = (T_odom_middle, judged.covariance), judged.since_previous_s
        if self._filter is None or since_s is None or self._filter.surprise(*measured, since_s) > TUNING.cut_chi2:
            self._filter = MotionFilter.begun(*measured, self._process_noise)
        else:
            self._filter = self._filter.updated(*measured, since_s)
        return self._filter.motion

    @property
    def _process_noise(self) -> ProcessNoise:
        """The camera's acceleration as it was seen last, also before a loss."""
        return ProcessNoise() if self._filter is None else self._filter.process_noise

    def _move_origin(self, motion: Motion, judged: JudgedFrame, sensor: SensorModel) -> Motion:
        """Put the origin of odom where it is known to be now, by a segment's second frame or by a new timing.

        Returns the filtered `motion` in odom as it is then.
        """
        odom, reference = self._odom, self._map.keyframes[judged.tracked.reference]
        origin = odom.origin
        if origin is None or self._filter is None or origin.segment != reference.segment:
            return motion
        if origin.velocity is None and judged.since_previous_s is None:
            odom.origin = None
            return motion
        velocity = origin.velocity or Velocity(motion.twist, motion.P[6:, 6:])
        moved = origin.with_velocity(velocity, sensor.timing)
        if origin.velocity is None or moved.delay_s != origin.delay_s:
            self._filter = self._filter.moved(odom.move_origin(moved))
        return self._filter.motion

    def _with_motions(self, current: PublishedPose, judged: JudgedFrame, sensor: SensorModel) -> PublishedPose:
        """Return a published pose with the motions since the frame before and over a second, None where not known.

        None is published since a pose that was only predicted: this one may have proved it wrong.
        """
        inliers, step, second = judged.tracked.inlier_count, None, None
        last = self._recent.last
        if last is not None and not last.is_predicted and judged.since_previous_s is not None:
            step = self._motion_since(last, current, inliers, sensor)
        then = self._recent.a_second_before(current.frame.stamp)
        if then is not None:
            second = self._motion_since(then, current, inliers, sensor)
        return replace(current, step=step, second=second)

    def bridge(self, view: View, since_s: float, sensor: SensorModel) -> PublishedPose:
        """Publish what the filtered motion predicts for a frame that could not be tracked, `since_s` after the last."""
        last = self._recent.last
        assert last is not None
        assert last.frame.T_keyframe_camera is not None
        assert self._filter is not None
        predicted = self._filter.motion.after(since_s + view.since_middle_s(sensor.timing), self._process_noise)
        step = se3.inverse(last.T_odom_camera) @ predicted.T_fixed_camera
        frame = replace(
            last.frame,
            stamp=view.stamp,
            T_keyframe_camera=last.frame.T_keyframe_camera @ step,
            covariance=predicted.covariance,
            twist=predicted.twist,
        )
        doubt = last.doubt.after(step, None, (view.stamp - last.frame.stamp) * 1e-9)
        return self._publish(frame, predicted.T_fixed_camera, doubt, sensor, is_predicted=True)

    def follow(self, view: View, placed: PosedFrame, following: SurfaceFollowing, sensor: SensorModel) -> PublishedPose:
        """Publish where surfaces have led the camera since the frame of `placed`, the last that landmarks placed."""
        reference = self._map.keyframes[placed.reference]
        T_map_camera = placed.T_map_camera @ following.T_placed_after(view.since_middle_s(sensor.timing))
        T_reference_camera = reference.T_camera_map @ T_map_camera
        pose = reference.number, T_reference_camera, following.covariance
        frame = LoggedFrame(view.stamp, reference.segment, None, *pose)
        last, T_odom_camera = self._newest, self._odom.pose(T_map_camera)
        assert last is not None
        dt, step = (view.stamp - last.frame.stamp) * 1e-9, se3.inverse(last.T_odom_camera) @ T_odom_camera
        return self._publish(frame, T_odom_camera, last.doubt.after(step, None, dt), sensor)

    def _publish(
        self, frame: LoggedFrame, T_odom_camera: Array, doubt: Doubt, sensor: SensorModel, is_predicted: bool = False
    ) -> PublishedPose:
        """Log and publish a frame that landmarks did not place; no motions are published to it."""
        self.log.append(frame)
        since_start = self._since_start(frame, T_odom_camera, doubt, sensor)
        return self._keep(PublishedPose(frame, T_odom_camera, since_start, doubt=doubt, is_predicted=is_predicted))

    def lose(self, stamp: Stamp, segment: int) -> None:
        """Log a frame without a pose; no motion is published over it."""
        self.log.append(LoggedFrame(stamp, segment))
        self._recent.clear()

    def _keep(self, current: PublishedPose) -> PublishedPose:
        self._recent.append(current)
        self._newest = current
        return current

    def _motion_since(
        self, earlier: PublishedPose, current: PublishedPose, inliers: int, sensor: SensorModel
    ) -> RelativePose | None:
        T_earlier_current = se3.inverse(earlier.T_odom_camera) @ current.T_odom_camera
        now = current.frame, T_earlier_current, current.doubt
        covariance = covariance_of_motion(self._map, earlier, *now, sensor)
        if covariance is None:
            return None
        return RelativePose(earlier.frame.stamp, T_earlier_current, covariance, inliers)

    def _doubt(self, T_odom_camera: Array, judged: JudgedFrame, moving: MovingView) -> Doubt:
        """Return how far the camera may have gone astray, at a judged frame's pose: nothing where it is known again.

        What is first seen to move now counts as moving since the look before.
        """
        last = self._newest
        if last is None:
            return Doubt()
        if moving.witnesses.is_rooted and not moving.is_doubtful:
            return last.doubt.known_again()
        since_s = (judged.since_previous_s or 0.0) + (0.0 if last.doubt.is_open else TUNING.moving_period_s)
        spread = moving.rivals.spread if moving.is_doubtful else None
        return last.doubt.after(se3.inverse(last.T_odom_camera) @ T_odom_camera, spread, since_s)

    def _since_start(self, frame: LoggedFrame, T_odom_camera: Array, doubt: Doubt, sensor: SensorModel) -> Array | None:
        """Return the 6 x 6 covariance of a pose in odom since its segment began."""
        then = self._corrected, self._odom.origin
        return covariance_of_pose(self._map, *then, frame, T_odom_camera, doubt, sensor)
