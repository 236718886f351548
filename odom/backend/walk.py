"""The camera's walk through the map: frame by frame it goes on, is predicted, is lost, or begins anew."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from odom.backend.belief import verdict
from odom.backend.causal import CausalTrajectory, Publication
from odom.backend.closing_test import closing_test
from odom.backend.estimate import ClosingTest, Estimate, Features, LoopCandidate, State, TrajectoryPose
from odom.backend.following import follow, follow_coarsely, relocalise
from odom.backend.growth import Growth
from odom.backend.history import trajectory
from odom.backend.loops import act_on
from odom.backend.mapper import Mapper
from odom.backend.pairwise import register_successive
from odom.backend.placed import Placed
from odom.backend.seen_noise import after_frame
from odom.backend.selfcheck import SelfCheck
from odom.backend.settings import OdometrySettings
from odom.backend.sight import Sight
from odom.backend.sightings import settled
from odom.backend.stopwatch import Stopwatch
from odom.backend.tracking import Tracked
from odom.backend.whereabouts import Previous, Whereabouts
from odom.frame import Camera, Stamp
from odom.frontend.clock import Clock
from odom.frontend.images import FrameImages
from odom.frontend.lens import Lens
from odom.frontend.measure import FeatureNoise
from odom.frontend.places import describe_place
from odom.frontend.view import View
from odom.registration import se3

Array = NDArray[np.float64]

_LONGEST_GAP_S, _LONGEST_GAP_PERIODS = 0.2, 2.5
_LEAST_CORNERS = 50
_LONGEST_BLIND_PERIODS = 1.5
_CHECKED_ALL, _CHECK_EVERY = 20, 4
_UNEQUAL = 0.2
_AT_REST = np.zeros(6)


class Walk:
    """The walk of one camera: where it was last, what was published of it (`causal`), and its map (`mapper`).

    The clock that each step is given has that step's frame as its newest.
    """

    def __init__(self, camera: Camera, settings: OdometrySettings) -> None:
        self._camera, self._settings = camera, settings
        knots = np.array([0.15, 0.3, 0.5, 0.8, 1.2, 2.0])
        table = np.stack([knots, np.full_like(knots, settings.inverse_depth_sigma)])
        self._check = SelfCheck.of(FeatureNoise(settings.pixel_sigma_px, table))
        self.mapper = Mapper(camera, Lens.of(camera), settings)
        self.causal = CausalTrajectory(self.mapper.map)
        self._growth = Growth(self.mapper)
        self._was: Whereabouts | None = None
        self._sight = Sight()

    @property
    def previous(self) -> Previous | None:
        """The last frame that was tracked or began a segment."""
        return None if self._was is None else self._was.previous

    def follow_coarsely(self, images: FrameImages, stamp: Stamp) -> Array:
        """Return T_camera_map of `images` of the steady `stamp`, followed from the `previous` frame."""
        assert self._was is not None
        return follow_coarsely(self._was, self.mapper, images, stamp)

    def step(self, view: View, clock: Clock, T_coarse: Array | None, watch: Stopwatch) -> Estimate:
        """Return the estimate for the next frame; `T_coarse` (T_camera_map) is where it was followed to already."""
        self._sight = self._sight.after(view.stamp, view.frame.depth_mm)
        was_lost = self.causal.is_lost
        is_blind = self._sight.is_blind(
            view.stamp, max(self._settings.bridge_s, _LONGEST_BLIND_PERIODS * clock.period_s)
        )
        tracked = None if was_lost or is_blind else self._follow(view, clock, T_coarse, watch)
        is_recovered, place = False, None
        if tracked is None and not is_blind:
            place = describe_place(view, self.mapper.lens, _AT_REST, self.mapper.timing, self._check.noise)
            tracked = relocalise(self._was, self.mapper, self._check, view, place)
            is_recovered = tracked is not None
            watch.lap("relocalise")
        if tracked is not None:
            return self._advance(view, clock, tracked, is_recovered, watch)
        if not (was_lost or is_blind) and 0.0 < self._since_previous_s(view) <= self._settings.bridge_s:
            return self._bridge(view)
        return self._lose(view, None if place is None else len(place.points))

    def take_background(self, count: int | None) -> tuple[tuple[LoopCandidate, ...], bool]:
        """Take over what the background has for frame `count` (None: all it has); say whether the map moved.

        The current pose goes with the map; over a closure, its pose in odom stays what it was.
        """
        was, map_ = self._was, self.mapper.map
        if was is None:
            return (), False
        T_near_camera = was.T_near_camera(map_)
        described = self.mapper.take_background(count, self._check)
        if described is None:
            return (), False
        near = map_.keyframes[was.near]
        T_near_adjusted = near.T_camera_map
        loops = act_on(self.mapper, described, self._check)
        if any(loop.accepted for loop in loops):
            self.causal.correct(se3.inverse(near.T_camera_map) @ T_near_adjusted)
        self._was = was.with_map(map_, T_near_camera)
        return loops, True

    def forget(self) -> bool:
        """Forget the oldest key frames where there are too many; say whether there were."""
        return self._was is not None and self.mapper.forget(self._was.near, self._was.T_camera_map)

    def finish(self) -> tuple[tuple[TrajectoryPose, ...], tuple[LoopCandidate, ...]]:
        """Return the final trajectory after adjusting the whole map once more, and the loops judged meanwhile."""
        keyframes, frames = self.mapper.map.keyframes, self.causal.frames
        if self._was is None:
            return trajectory(frames, keyframes), ()
        newest = frames.count - 1
        tracked = self._newest_tracked()
        if tracked is not None:
            self.mapper.sight(newest, tracked)
        loops, _ = self.take_background(None)
        self.mapper.start_background(frames.count, self._check)
        loops += self.take_background(None)[0]
        T_near_camera = self._was.T_near_camera(self.mapper.map)
        adjusted = self.mapper.finish(self._check)
        self._was = self._was.with_map(self.mapper.map, T_near_camera)
        if newest in adjusted:
            self._was = replace(self._was, T_camera_map=adjusted[newest])
        return trajectory(settled(frames, keyframes, adjusted), keyframes), loops

    def closing_test(self) -> ClosingTest | None:
        """Return the paper's test of a closed walk after `finish`, None where it can't be made (see `closing_test`)."""
        last = self._newest_tracked()
        return None if self._was is None or last is None else closing_test(self.mapper, self._was, last, self._check)

    def _newest_tracked(self) -> Tracked | None:
        previous, last = self.previous, self.causal.frames.last
        return previous.tracked if previous and last and last.stamp == previous.view.stamp else None

    def _since_previous_s(self, view: View) -> float:
        return np.inf if self._was is None else self._was.since_s(view.frame.stamp)

    def _follow(self, view: View, clock: Clock, T_coarse: Array | None, watch: Stopwatch) -> Tracked | None:
        """Return the frame tracked on from the previous one, None where that fails."""
        dt = self._since_previous_s(view)
        longest = max(_LONGEST_GAP_S, _LONGEST_GAP_PERIODS * clock.period_s)
        if self._was is None or not 0.0 < dt < longest:
            return None
        return follow(self._was, self.mapper, self._check, view, watch, T_coarse)

    def _advance(self, view: View, clock: Clock, tracked: Tracked, is_recovered: bool, watch: Stopwatch) -> Estimate:
        """Take over a tracked frame: motion, covariance, key frame."""
        was, map_ = self._was, self.mapper.map
        assert was is not None
        dt = 0.0 if is_recovered else was.since_s(view.frame.stamp)
        step = se3.log(tracked.T_camera_map @ se3.inverse(was.T_camera_map))
        twist = -step / dt if dt else tracked.twist
        self._growth.go_on(twist if dt else None, self._check)
        map_.landmarks.tried[tracked.expected] += 1
        map_.landmarks.seen[tracked.inlying.rows] += 1
        is_regular = dt > 0.0 and abs(dt - clock.period_s) < _UNEQUAL * clock.period_s
        self._check = self._check.with_step(step if is_regular else None, tracked.information)
        if self._check.checks < _CHECKED_ALL or self.causal.frames.count % _CHECK_EVERY == 0:
            self._check = after_frame(self._check, map_, tracked, self._camera.width)
        watch.lap("check")
        covariance = tracked.covariance * self._check.scale
        near = map_.keyframes[tracked.reference]
        T_map_middle = se3.inverse(tracked.T_camera_map)
        published = self.causal.advance(
            Placed(
                view.stamp,
                near.segment,
                view.late_s + self.mapper.timing.readout_s / 2.0,
                near.number,
                near.T_camera_map @ T_map_middle,
            ),
            T_map_middle,
            covariance,
            dt,
            tracked.inlier_count,
            self._check,
            clock.sigma_s,
        )
        if self.mapper.sightings.wants(self.causal.frames.count - 1):
            self.mapper.sight(self.causal.frames.count - 1, tracked)
        before, pairwise = was.previous, None
        if dt and before.tracked is not None:
            pairwise = register_successive(
                before.tracked,
                was.T_camera_map,
                before.published,
                tracked,
                published,
                self._check.scale,
                clock.jitter_s,
            )
        watch.lap("pairwise")
        rows, uv = tracked.inlying.rows, tracked.inlying.uv
        self._sight = self._sight.placed(view.stamp, tracked.chi2[tracked.inliers, 1])
        self.mapper.start_background(self.causal.frames.count, self._check)
        if is_recovered:  # its motion, which bends what it measured, is not known: the next frame may be a key frame
            self._growth.look_again()
            is_keyframe = False
        else:
            is_keyframe = self._sight.deep_stamp == view.stamp and self._growth.is_due(tracked)
        if is_keyframe:
            near = self._growth.add(view, tracked, twist, near.segment, covariance, self._check)
            near.T_middle_stamp = published.T_middle_stamp
            rows, uv = near.rows, near.uv
        previous = Previous(view, tracked, pairwise, published, rows, uv)
        self._was = Whereabouts(previous, tracked.T_camera_map, twist, near.number)
        watch.lap("keyframe")
        state, reason = verdict(tracked, covariance, is_recovered, self._sight.is_shallow(view.stamp))
        residual = np.where(tracked.inliers, np.sqrt(tracked.chi2[:, 0]), np.nan)
        return replace(
            self._estimate(view, state, reason, published),
            inliers=tracked.inlier_count,
            matches=tracked.looked_for,
            is_keyframe=is_keyframe,
            pairwise=pairwise,
            features=Features(tracked.uv, residual),
        )

    def _bridge(self, view: View) -> Estimate:
        """Let the motion prediction stand in for a frame that could not be tracked."""
        assert self._was is not None
        self._was = replace(self._was, is_bridged=True)
        published = self.causal.bridge(view.stamp, self._was.twist, self._check)
        reason = "not tracked: the motion is predicted"
        return replace(self._estimate(view, State.UNCERTAIN, reason, published), is_predicted=True)

    def _lose(self, view: View, corners: int | None) -> Estimate:
        """Say that the frame has no pose, or begin a new segment where none can be hoped for.

        `corners` is how many show a depth, None without any depth: time in which there is nothing to see counts not.
        """
        reason = "no depth" if corners is None else "too little to see"
        if corners is not None and corners >= _LEAST_CORNERS:
            reason = "no known place recognised"
            self._sight = self._sight.astray(self.causal.since_last_s(view.stamp))
            if self._is_unproven or self._sight.astray_s > self._settings.new_segment_s:
                return self._begin_segment(view)
        self.causal.lose(view.stamp, self._segment)
        self.mapper.start_background(self.causal.frames.count, self._check)
        return self._estimate(view, State.LOST, reason, None)

    @property
    def _is_unproven(self) -> bool:
        """Whether there is nothing to be found again: no frame yet, or a single one that none was followed from."""
        return self._was is None or (len(self.mapper.map.keyframes) == 1 and self._was.previous.tracked is None)

    def _begin_segment(self, view: View) -> Estimate:
        """Begin a new segment of the map at the last known pose."""
        is_first = self._was is None
        T_camera_map = np.eye(4) if self._was is None else self._was.T_camera_map
        segment = 1 + max((k.segment for k in self.mapper.map.keyframes), default=-1)
        keyframe = self._growth.begin(view, T_camera_map, segment, self._check)
        self._sight = self._sight.begun(view.stamp)
        published = self.causal.begin(view.stamp, segment, keyframe.number, self._check)
        previous = Previous(view, None, None, published, keyframe.rows, keyframe.uv)
        self._was = Whereabouts(previous, T_camera_map, _AT_REST, keyframe.number)
        state = State.TRACKING if is_first else State.RECOVERED
        reason = "" if is_first else "new segment: no known place recognised"
        estimate = self._estimate(view, state, reason, published)
        return replace(estimate, matches=len(keyframe.rows), is_keyframe=True)

    @property
    def _segment(self) -> int:
        return -1 if self._was is None else self.mapper.map.keyframes[self._was.near].segment

    def _estimate(self, view: View, state: State, reason: str, published: Publication | None) -> Estimate:
        T_map_odom = self.causal.T_map_odom
        told = Estimate(view.frame.sequence, view.stamp, state, reason, max(self._segment, 0), T_map_odom)
        if published is None:
            return told
        return replace(
            told,
            T_odom_camera=published.T_odom_camera,
            covariance=published.covariance,
            step=published.step,
            second=published.second,
        )
