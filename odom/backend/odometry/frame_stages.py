"""The stages that place a frame: predict, track, judge, publish; else bridge, follow by surfaces, LOST, or begin."""

from dataclasses import replace

import numpy as np

from odom.backend.chain.chain import Chain
from odom.backend.chain.chain_frame import ChainFrame
from odom.backend.chain.named_features import NamedFeatures
from odom.backend.estimate import IMAGE_AGAIN, NO_DEPTH, NO_PLACE, TOO_LITTLE, Estimate, Features, State
from odom.backend.loop_closure.loop_closure import LoopCloser
from odom.backend.map.corners import Corners
from odom.backend.map.map import Map
from odom.backend.map.memory import open_map
from odom.backend.map.saved import SavedMap
from odom.backend.mapping.depth_filter import refine_depths
from odom.backend.mapping.mapper import Mapper
from odom.backend.mapping.presence import note_sightings
from odom.backend.odometry.judged_frame import JudgedFrame, PlacedFrame
from odom.backend.odometry.last_depth import LastDepth
from odom.backend.odometry.lost_camera import LostCamera
from odom.backend.odometry.moving_view import MovingView
from odom.backend.odometry.next_frame import is_next
from odom.backend.odometry.published_trajectory import PublishedTrajectory
from odom.backend.odometry.repeated_image import ShownDepth, is_repeated
from odom.backend.odometry.surface_following import SurfaceFollowing
from odom.backend.odometry.tuning import TUNING
from odom.backend.published_pose import PublishedPose
from odom.backend.settings import OdometrySettings
from odom.backend.stopwatch import Stopwatch
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.motion_model import AT_REST, mean_twist
from odom.backend.tracking.noise_check import noise_after
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.prediction import predict_pose
from odom.backend.tracking.quality import judge_pose
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.place_descriptor import describe_place
from odom.frontend.features.view import View
from odom.geometry.arrays import Array


class FrameStages:
    """The stages that place a frame, and what one frame hands to the next.

    `last` is the newest frame with a pose, None before the first; `sensor` what is known of the camera, with the
    newest frame's stamp in its clock. `mapper` extends the map and `closer` closes its loops; `published` and `chain`
    are the results; `moving` tells what moves in the view, `last_depth` how long the camera has been without depth.
    """

    def __init__(self, sensor: SensorModel, settings: OdometrySettings, saved: SavedMap | None = None) -> None:
        self.sensor = sensor
        self.last: PosedFrame | None = None
        self.map = Map() if saved is None else open_map(saved)
        self.tracker = FrameTracker(self.map, settings)
        self.mapper = Mapper(self.map, settings, sensor)
        self.closer = LoopCloser(self.map, self.tracker)
        self.published = PublishedTrajectory(self.map)
        self.chain = Chain()
        self._settings, self.moving, self.last_depth = settings, MovingView(), LastDepth()
        self._shown_depth: ShownDepth | None = None
        self._lost_camera = LostCamera(self.map, self.published.log, self.tracker, self.mapper.inserter, settings)

    def place(self, view: View, T_predicted: Array | None, watch: Stopwatch) -> tuple[Estimate, PlacedFrame | None]:
        """Return the estimate for the next frame, and what chain and map need of it; None unless landmarks placed it.

        `T_predicted` is T_camera_map where it was predicted already.
        """
        self._shown_depth = ShownDepth.of(view, self._shown_depth)
        if self._shown_depth.is_stale(self.last, self.sensor):
            view = view.without_depth()
        if view.shows_depth:
            self.last_depth = self.last_depth.after_depth(view.steady_stamp)
        if self.last is not None and is_repeated(view, self.last, self.sensor):
            bridged = self._bridge(view, IMAGE_AGAIN)
            if bridged is not None or self.last.tracked is not None:
                return bridged or self._report(view, IMAGE_AGAIN, self._follow_surfaces(view, is_again=True)), None
        tracked = self._track(view, T_predicted, watch)
        if tracked is not None:
            return self._publish(self._judge(view, tracked, is_recovered=False), watch)
        if self.last_depth.is_blind(view.steady_stamp, self._settings.bridge_s, self.sensor.clock.period_s):
            return self._report(view, NO_DEPTH), None
        place = describe_place(view, self.sensor, AT_REST)
        in_doubt = self.moving.is_doubtful
        self.last, tracked, is_near = self._lost_camera.find(self.last, view, place, self.sensor, in_doubt)
        watch.lap("relocalise")
        if tracked is not None:
            is_recovered = not (is_near and self._is_followable(view))
            return self._publish(self._judge(view, tracked, is_recovered), watch)
        if (bridged := self._bridge(view, "not tracked")) is not None:
            return bridged, None
        following = self._follow_surfaces(view, is_again=False)
        if not self._lost_camera.sees_enough(view, place, self.sensor):
            return self._report(view, TOO_LITTLE, following), None
        return self._begin_if_due(view, following), None

    def _track(self, view: View, T_predicted: Array | None, watch: Stopwatch) -> TrackedFrame | None:
        """Predict and track the frame from the newest one with a pose; None where that fails."""
        last, tracker, sensor, in_doubt = self.last, self.tracker, self.sensor, self.moving.is_doubtful
        if last is None or not self._is_followable(view):
            return None
        if T_predicted is None:
            T_predicted = predict_pose(self.map, last, view.images, view.steady_stamp, sensor)
        watch.lap("predict")
        since_s = last.since_s(view.steady_stamp)
        tracked = tracker.follow(last, view, sensor, T_predicted, last.twist_to(T_predicted, since_s), in_doubt)
        if tracked is not None and last.is_bent and since_s < TUNING.longest_gap_s:
            # The motion to a segment's second frame tells how the first one's rows are bent. The rows themselves
            # cannot: landmarks bent in the first frame look straight in the second.
            twist = mean_twist(last.T_map_camera, tracked.T_camera_map, since_s)
            self.mapper.inserter.remeasure_first(last.reference, last.view, twist, sensor)
            self.last = replace(last, twist=twist, is_bent=False)
            tracked = tracker.follow(self.last, view, sensor, tracked.T_camera_map, twist, in_doubt)
        watch.lap("track")
        return tracked

    def _is_followable(self, view: View) -> bool:
        """Return whether the frame before has a pose, and the newest tracked one is so recent that its motion tells."""
        if self.last is None or self.published.log.is_lost:
            return False
        return is_next(self.last.since_s(view.steady_stamp), self.sensor.clock.period_s)

    def _judge(self, view: View, tracked: TrackedFrame, is_recovered: bool) -> JudgedFrame:
        """Learn from a tracked frame what it shows of noise, landmarks and bodies; return how far to trust its pose.

        The newest key frame is measured again by the motion that led here from it.
        """
        last, clock = self.last, self.sensor.clock
        since_s = None if is_recovered or last is None else last.since_s(view.steady_stamp)
        if last is not None and last.is_bent and last.since_s(view.steady_stamp) >= TUNING.longest_gap_s:
            self.mapper.inserter.recent.remember(last)  # over so long a step its bend hardly counts
        led_here = None
        if last is not None and since_s is not None and since_s < TUNING.longest_gap_s:
            led_here = mean_twist(last.T_map_camera, tracked.T_camera_map, since_s)
        twist = tracked.twist if led_here is None else led_here
        self.mapper.inserter.remeasure_newest(led_here, self.sensor)
        note_sightings(self.map, tracked, since_s or 0.0, self.moving.is_doubtful)
        is_one_period = since_s is not None and abs(since_s - clock.period_s) < TUNING.steady_share * clock.period_s
        step = last.step_to(tracked) if last is not None and is_one_period else None
        number, width = self.published.log.count, view.images.full.shape[1]
        noise = noise_after(self.sensor.noise, self.map, tracked, step, number, width)
        self.sensor = self.sensor.with_noise(noise)
        covariance, tilt = tracked.covariance * noise.covariance_scale, self.sensor.depth_tilt.angles
        vague = refine_depths(self.map, tracked.inlier_landmarks, tracked.T_camera_map, covariance, tilt)
        moving = self.moving.restarted(self.map.landmarks.next_identity) if is_recovered else self.moving
        self.moving = moving.after(view, tracked, self.mapper.inserter.recent, self.map.landmarks, self.sensor)
        self.last_depth = self.last_depth.after_tracked(view.steady_stamp, tracked.chi2[tracked.inliers, 1])
        lacks_depth = self.last_depth.is_shallow(view.steady_stamp)
        self._lost_camera.end_search()
        state, reason = judge_pose(tracked, vague, covariance, is_recovered, lacks_depth, self.moving.doubt)
        return JudgedFrame(view, tracked, since_s, twist, covariance, state, reason)

    def _publish(self, judged: JudgedFrame, watch: Stopwatch) -> tuple[Estimate, PlacedFrame | None]:
        """Publish a judged frame; where it followed a body, report it as LOST or begin instead."""
        if self.moving.rivals.is_left_behind:
            self.mapper.inserter.drop(judged.tracked, self.moving.witnesses.unproven_identity, self.sensor)
            return self._begin_if_due(judged.view), None
        watch.lap("judge")
        tracked, published = judged.tracked, self.published.advance(judged, self.moving, self.sensor)
        estimate = replace(
            self._describe(judged.view, judged.state, judged.reason, published),
            inliers=tracked.inlier_count,
            matches=len(tracked.looked_for),
            features=Features(tracked.uv, np.where(tracked.inliers, np.sqrt(tracked.chi2[:, 0]), np.nan)),
        )
        return estimate, PlacedFrame(judged, published)

    def _bridge(self, view: View, why: str) -> Estimate | None:
        """Let the motion prediction stand in for a frame that could not be tracked; None after too long a time."""
        since_s = 0.0 if self.last is None else self.last.since_s(view.steady_stamp)
        if self.last is None or self.published.log.is_lost or not 0.0 < since_s <= self._settings.bridge_s:
            return None
        self.last = replace(self.last, is_bridged=True)
        published = self.published.bridge(view, since_s, self.sensor)
        return self._describe(view, State.UNCERTAIN, f"{why}: the motion is predicted", published)

    def _follow_surfaces(self, view: View, is_again: bool) -> SurfaceFollowing | None:
        """Return where surfaces led the camera; None where they don't, or where colour is no reason to follow them.

        It is one where the image shows hardly any corners, or is the last one once more (`is_again`).
        """
        may_begin = self._is_followable(view) and self.moving.is_at_rest
        placed = self.last if may_begin and (is_again or self.mapper.inserter.is_bare(view, self.sensor)) else None
        return self._lost_camera.follow_surfaces(view, placed, self.sensor)

    def _begin_if_due(self, view: View, following: SurfaceFollowing | None = None) -> Estimate:
        """Report a frame that shows no known place, or begin; time with nothing to see does not count as looking."""
        corners = self._lost_camera.first_corners(self.last, view, self.sensor, self.moving.is_doubtful)
        reason = NO_PLACE if self.map.keyframes else TOO_LITTLE
        return self._report(view, reason, following) if corners is None else self._begin(view, corners, following)

    def _report(self, view: View, reason: str, following: SurfaceFollowing | None = None) -> Estimate:
        """Report the frame as LOST, or as UNCERTAIN where surfaces led."""
        state, published = State.LOST, None
        if following is None or self.last is None:
            self.published.lose(view.stamp, self._segment)
        else:
            published = self.published.follow(view, self.last, following, self.sensor)
            state, reason = State.UNCERTAIN, f"{reason}: followed by surfaces alone"
        self.mapper.start_background(self.published.log, self.sensor)
        return self._describe(view, state, reason, published)

    def _begin(self, view: View, corners: Corners, following: SurfaceFollowing | None) -> Estimate:
        """Begin a new segment of the map at the last known pose, or go on with the last one where surfaces led."""
        is_first, in_doubt, against = self.last is None, self.moving.is_doubtful, None
        T_camera_map, twist = np.eye(4) if self.last is None else self.last.T_camera_map, None
        if following is not None and self.last is not None:
            (T_camera_map, against), twist = following.pose_after(self.last), following.motion.twist
        keyframe = self.mapper.inserter.begin(view, corners, T_camera_map, self.sensor, in_doubt, against)
        self.last_depth, self.moving = self.last_depth.after_beginning(view.steady_stamp), self.moving.restarted(0)
        self._lost_camera.end_search()
        published = self.published.begin(view, keyframe, self.sensor, twist)
        chain = self.chain.extend(ChainFrame(view, NamedFeatures.nothing(), AT_REST, published), None, self.sensor)
        self.chain.close(self.map, True, keyframe.number, self.sensor)
        self.last = PosedFrame.at_beginning(view, T_camera_map, keyframe)
        begun = "new segment" if against is None else "gone on where surfaces led"
        why = (State.TRACKING, "") if is_first else (State.RECOVERED, f"{begun}: {NO_PLACE}")
        return replace(self._describe(view, *why, published), matches=len(keyframe.rows), is_keyframe=True, chain=chain)

    @property
    def _segment(self) -> int:
        return 0 if self.last is None else self.map.keyframes[self.last.reference].segment

    def _describe(self, view: View, state: State, reason: str, published: PublishedPose | None) -> Estimate:
        """Return the estimate for a frame as it was published, without a pose where None."""
        segment = self._segment if published is None else published.frame.segment
        estimate = Estimate(view.sequence, view.stamp, state, reason, segment, self.published.T_map_odom.copy())
        return estimate if published is None else published.in_estimate(estimate)
