"""Frames to poses: predict, track, grow the map, and say how far to trust it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.backend.belief import verdict
from odom.backend.causal import CausalTrajectory, Publication
from odom.backend.closing_test import closing_test
from odom.backend.estimate import ClosingTest, Estimate, Features, LoopCandidate, RelativePose, State, TrajectoryPose
from odom.backend.following import Previous, Whereabouts, follow, follow_coarsely, relocalise
from odom.backend.growth import Growth
from odom.backend.history import trajectory
from odom.backend.loops import act_on
from odom.backend.mapper import Mapper
from odom.backend.pairwise import register_successive
from odom.backend.placed import Placed
from odom.backend.selfcheck import SelfCheck
from odom.backend.settings import OdometrySettings
from odom.backend.sight import LEAP_S, Sight
from odom.backend.sightings import settled
from odom.backend.stopwatch import Stopwatch
from odom.backend.tracking import INLIER_CHI2, Tracked, disagreement
from odom.errors import ConfigError, InputError
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.clock import Clock
from odom.frontend.images import FrameImages
from odom.frontend.lens import Lens
from odom.frontend.measure import FeatureNoise
from odom.frontend.places import describe_place
from odom.frontend.timing import Timing
from odom.frontend.view import View
from odom.registration import se3

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_LONGEST_GAP_S, _LONGEST_GAP_PERIODS = 0.2, 2.5
_LEAST_CORNERS = 50
_LEAST_SIDE_PX = 64
_LONGEST_BLIND_PERIODS = 1.5
_CHECKED_ALL, _CHECK_EVERY = 20, 4
_UNEQUAL = 0.2


@dataclass(frozen=True, eq=False)
class _Glance:
    """What a colour image told before its depth was there: `T_coarse` (T_camera_map) as followed from `previous`."""

    color: NDArray[np.uint8]
    images: FrameImages
    previous: Previous
    T_coarse: Array
    laps_ms: dict[str, float]


class Odometry:
    """The odometry of one RGB-D camera: give it frames in order, it gives an estimate for each.

    Deterministic: what runs in the background takes effect at a fixed frame number, never by the clock; time is that
    of the frames' stamps. A frame that cannot be placed is LOST, a value. Raises ConfigError for a camera of which
    nothing can be tracked, or whose lens is not known here.
    """

    def __init__(self, camera: Camera, settings: OdometrySettings | None = None) -> None:
        if min(camera.width, camera.height) < _LEAST_SIDE_PX:
            raise ConfigError(f"{camera}: images need {_LEAST_SIDE_PX} pixels each way at least")
        self.settings = settings or OdometrySettings()
        self.camera = camera
        knots = np.array([0.15, 0.3, 0.5, 0.8, 1.2, 2.0])
        table = np.stack([knots, np.full_like(knots, self.settings.inverse_depth_sigma)])
        self._check = SelfCheck.of(FeatureNoise(self.settings.pixel_sigma_px, table))
        self._mapper = Mapper(camera, Lens.of(camera), self.settings)
        self._growth = Growth(self._mapper)
        self._causal = CausalTrajectory(self._mapper.map)
        self._T_camera_map, self._T_map_odom = np.eye(4), np.eye(4)
        self._twist = np.zeros(6)
        self._near, self._segment = 0, -1
        self._clock = Clock()
        self._previous: Previous | None = None
        self._glance: _Glance | None = None
        self._sight = Sight()
        self.late_loops: tuple[LoopCandidate, ...] = ()
        """What the last `finish` judged, after the last frame."""

    @property
    def timing(self) -> Timing:
        """The sensor's timing as estimated so far."""
        return self._mapper.timing

    @property
    def forgotten_keyframes(self) -> int:
        """How many key frames were forgotten, for the map to stay within `map_keyframes`."""
        return self._mapper.forgotten

    @property
    def forgotten_frames(self) -> int:
        """How many frames were dropped from the final trajectory: those older than the last eight hours."""
        return self._causal.frames.dropped

    def anticipate(self, stamp: Stamp, color: NDArray[np.uint8]) -> None:
        """Do already what needs no depth, for the frame that will hold this very `color` (grey or RGB) of `stamp`.

        The estimates are the same with and without, but sooner: a Kinect's depth comes milliseconds behind its colour.
        """
        if self._previous is None or self._causal.is_lost or color.shape[:2] != self._previous.view.images.full.shape:
            return
        watch = Stopwatch()
        images = FrameImages.of(color)
        watch.lap("images")
        dt = (self._clock.after(stamp).steady - self._previous.view.frame.stamp) * 1e-9
        T_coarse = follow_coarsely(self._whereabouts(self._previous), self._mapper, images, dt)
        watch.lap("follow")
        self._glance = _Glance(color, images, self._previous, T_coarse, watch.laps_ms)

    def process(self, frame: RgbdFrame) -> Estimate:
        """Return the estimate for the next frame.

        Raises InputError for a frame whose size is not the camera's, or whose stamp is the last one's or up to a
        second before it; a leap further back is a new time, in which the camera has to be found again.
        """
        if frame.depth_mm.shape != (self.camera.height, self.camera.width):
            raise InputError(
                f"a frame of {frame.depth_mm.shape[::-1]} pixels from {self.camera}: give that camera's own"
            )
        if -LEAP_S <= self._causal.since_last_s(frame.stamp) <= 0.0:
            raise InputError(f"frame {frame.sequence} is not later than the one before: give frames in order of time")
        self._clock = self._clock.after(frame.stamp)
        glance, self._glance = self._glance, None
        if glance is not None and (glance.color is not frame.color or glance.previous is not self._previous):
            glance = None
        watch = Stopwatch(None if glance is None else glance.laps_ms)
        images = FrameImages.of(frame.color) if glance is None else glance.images
        view = View.of(frame, self._clock, images)
        watch.lap("images")
        loops, map_moved = self._take_background(self._causal.frames.count)
        map_moved |= self._mapper.forget(self._near, self._T_camera_map)
        watch.lap("background")
        self._sight = self._sight.after(view.stamp, frame.depth_mm)
        was_lost, is_blind = self._causal.is_lost, self._is_blind(view.stamp)
        T_coarse = None if glance is None or map_moved else glance.T_coarse
        tracked = None if was_lost or is_blind else self._follow(view, watch, T_coarse)
        is_recovered = False
        if tracked is None and not is_blind and self._mapper.map.keyframes:
            tracked = self._relocalise(view)
            is_recovered = tracked is not None
            watch.lap("relocalise")
        if tracked is not None:
            estimate = self._advance(view, tracked, is_recovered, watch)
        elif not (was_lost or is_blind) and 0.0 < self._since_previous_s(view) <= self.settings.bridge_s:
            estimate = self._bridge(view)
        else:
            estimate = self._lose(view, is_blind)
        if map_moved or estimate.is_keyframe:
            estimate = replace(estimate, path=self._mapper.map.path(), landmarks_map=self._mapper.map.cloud())
        return replace(estimate, loops=loops, timings_ms=watch.laps_ms)

    def finish(self) -> tuple[TrajectoryPose, ...]:
        """Return the final corrected trajectory after adjusting the whole map once more.

        It holds one pose a frame, of the last eight hours (see `PlacedFrames`).
        """
        keyframes, frames, previous = self._mapper.map.keyframes, self._causal.frames, self._previous
        if not keyframes:
            return trajectory(frames, keyframes)
        newest, last = frames.count - 1, frames.last
        if previous and previous.tracked and last and last.stamp == previous.view.stamp:
            self._mapper.sight(newest, previous.tracked)
        loops, _ = self._take_background(None)
        self._mapper.start_background(frames.count, self._check)
        self.late_loops = loops + self._take_background(None)[0]
        near = keyframes[self._near]
        T_near_camera = near.T_camera_map @ se3.inverse(self._T_camera_map)
        adjusted = self._mapper.finish(self._check)
        self._T_camera_map = adjusted.get(newest, se3.inverse(T_near_camera) @ near.T_camera_map)
        return trajectory(settled(frames, keyframes, adjusted), keyframes)

    def closing_test(self) -> ClosingTest | None:
        """Return the paper's test of a closed walk after `finish`, None where it can't be made (see `closing_test`)."""
        last, keyframes = self._previous, self._mapper.map.keyframes
        if last is None or last.tracked is None:
            return None
        return closing_test(
            self._mapper,
            keyframes[keyframes[self._near].first],
            last.view,
            self._T_camera_map,
            last.tracked.twist,
            last.pairwise,
            self._check,
        )

    def _since_previous_s(self, view: View) -> float:
        """Return the steady time since the previous view."""
        return np.inf if self._previous is None else (view.frame.stamp - self._previous.view.frame.stamp) * 1e-9

    def _take_background(self, count: int | None) -> tuple[tuple[LoopCandidate, ...], bool]:
        """Take over what the background has for frame `count` (None: all it has); say whether the map moved.

        The current pose goes with the map; over a closure, its pose in odom stays what it was.
        """
        if not self._mapper.map.keyframes:
            return (), False
        near = self._mapper.map.keyframes[self._near]
        T_near_camera = near.T_camera_map @ se3.inverse(self._T_camera_map)
        described = self._mapper.take_background(count, self._check)
        if described is None:
            return (), False
        T_near_adjusted = near.T_camera_map
        loops = act_on(self._mapper, described, self._check)
        if any(loop.accepted for loop in loops):
            self._T_map_odom = se3.inverse(near.T_camera_map) @ T_near_adjusted @ self._T_map_odom
            self._segment = near.segment
        self._T_camera_map = se3.inverse(T_near_camera) @ near.T_camera_map
        return loops, True

    def _whereabouts(self, previous: Previous) -> Whereabouts:
        last = self._causal.frames.last
        is_bridged = last is not None and last.stamp != previous.view.stamp
        return Whereabouts(previous, self._T_camera_map, self._twist, self._near, is_bridged)

    def _follow(self, view: View, watch: Stopwatch, T_coarse: Array | None) -> Tracked | None:
        """Return the frame tracked on from the previous one, None where that fails."""
        dt = self._since_previous_s(view)
        longest = max(_LONGEST_GAP_S, _LONGEST_GAP_PERIODS * self._clock.period_s)
        if self._previous is None or not 0.0 < dt < longest:
            return None
        was = self._whereabouts(self._previous)
        return follow(was, self._mapper, self._check, view, dt, watch, T_coarse)

    def _relocalise(self, view: View) -> Tracked | None:
        """Return the frame tracked from wherever it is recognised to be, None where that is nowhere."""
        was = None if self._previous is None else self._whereabouts(self._previous)
        tracked = relocalise(was, self._mapper, self._check, view, self._since_previous_s(view))
        if tracked is not None:
            self._segment = self._mapper.map.keyframes[tracked.reference].segment
        return tracked

    def _advance(self, view: View, tracked: Tracked, is_recovered: bool, watch: Stopwatch) -> Estimate:
        """Take over a tracked frame: motion, covariance, key frame."""
        previous, T_before = self._previous, self._T_camera_map
        dt = 0.0 if is_recovered else self._since_previous_s(view)
        self._T_camera_map, self._near = tracked.T_camera_map, tracked.reference
        step = se3.log(self._T_camera_map @ se3.inverse(T_before))
        twist = -step / dt if dt else tracked.twist
        self._twist = twist
        self._growth.go_on(twist if dt else None, self._check)
        landmarks = self._mapper.map.landmarks
        landmarks.tried[tracked.expected] += 1
        landmarks.seen[tracked.inlying.rows] += 1
        is_regular = dt > 0.0 and abs(dt - self._clock.period_s) < _UNEQUAL * self._clock.period_s
        self._check = self._check.with_step(step if is_regular else None, tracked.information)
        if self._check.checks < _CHECKED_ALL or self._causal.frames.count % _CHECK_EVERY == 0:
            self._check_noise(tracked)
        watch.lap("check")
        covariance = tracked.covariance * self._check.scale
        keyframe = self._mapper.map.keyframes[self._near]
        T_map_middle = se3.inverse(self._T_camera_map)
        published = self._causal.advance(
            Placed(
                view.stamp,
                self._segment,
                view.late_s + self.timing.readout_s / 2.0,
                self._near,
                keyframe.T_camera_map @ T_map_middle,
            ),
            se3.inverse(self._T_map_odom) @ T_map_middle,
            covariance,
            dt,
            tracked.inlier_count,
            self._check,
            self._clock.sigma_s,
        )
        if self._mapper.sightings.wants(self._causal.frames.count - 1):
            self._mapper.sight(self._causal.frames.count - 1, tracked)
        pairwise = None
        if dt and previous is not None and previous.tracked is not None:
            pairwise = register_successive(
                previous.tracked, previous.published, tracked, published, self._check.scale, self._clock.jitter_s
            )
        watch.lap("pairwise")
        rows, uv = tracked.inlying.rows, tracked.inlying.uv
        self._sight = self._sight.placed(view.stamp, tracked.chi2[tracked.inliers, 1])
        self._mapper.start_background(self._causal.frames.count, self._check)
        if is_recovered:  # its motion, which bends what it measured, is not known: the next frame may be a key frame
            self._growth.look_again()
            is_keyframe = False
        else:
            is_keyframe = self._sight.deep_stamp == view.stamp and self._growth.is_due(tracked)
        if is_keyframe:
            keyframe = self._growth.add(view, tracked, twist, self._segment, covariance, self._check)
            self._near, rows, uv = keyframe.number, keyframe.rows, keyframe.uv
        self._previous = Previous(view, tracked, pairwise, published, rows, uv)
        watch.lap("keyframe")
        state, reason = verdict(tracked, covariance, is_recovered, self._sight.is_shallow(view.stamp))
        residual = np.where(tracked.inliers, np.sqrt(tracked.chi2[:, 0]), np.nan)
        return self._estimate(
            view,
            state,
            reason,
            published,
            inliers=tracked.inlier_count,
            matches=tracked.looked_for,
            is_keyframe=is_keyframe,
            pairwise=pairwise,
            features=Features(tracked.uv, residual),
        )

    def _check_noise(self, tracked: Tracked) -> None:
        chosen = tracked.inliers & (tracked.chi2[:, 1] < INLIER_CHI2)
        self._check = self._check.with_residuals(tracked.chi2[chosen], tracked.measurements.values[chosen, 2])
        nees = disagreement(self._mapper.map, tracked, self.camera.width)
        if nees is not None:
            self._check = self._check.with_disagreement(nees)

    def _bridge(self, view: View) -> Estimate:
        """Let the motion prediction stand in for a frame that could not be tracked."""
        published = self._causal.bridge(view.stamp, self._twist)
        reason = "not tracked: the motion is predicted"
        return self._estimate(view, State.UNCERTAIN, reason, published, is_predicted=True)

    def _is_blind(self, stamp: Stamp) -> bool:
        """Say whether there has been no depth at all for longer than a prediction may stand in."""
        longest = max(self.settings.bridge_s, _LONGEST_BLIND_PERIODS * self._clock.period_s)
        return self._sight.without_depth_s(stamp) > longest

    def _lose(self, view: View, is_blind: bool) -> Estimate:
        """Say that the frame has no pose, or begin a new segment where none can be hoped for."""
        if not is_blind:
            self._sight = self._sight.astray(self._causal.since_last_s(view.stamp))
        may_wait = self._segment >= 0 and not self._is_unproven and self._sight.astray_s <= self.settings.new_segment_s
        if not (is_blind or may_wait):
            estimate = self._begin_segment(view)
            if estimate is not None:
                return estimate
        self._causal.lose(view.stamp, self._segment)
        self._mapper.start_background(self._causal.frames.count, self._check)
        reason = "no depth" if is_blind else "no known place recognised"
        if self._segment < 0:
            reason = "no depth yet"
        return self._estimate(view, State.LOST, reason, None)

    @property
    def _is_unproven(self) -> bool:
        """Whether the map is a single frame, which none was followed from: there is nothing to be found again."""
        is_alone = len(self._mapper.map.keyframes) == 1
        return is_alone and self._previous is not None and self._previous.tracked is None

    def _begin_segment(self, view: View) -> Estimate | None:
        """Begin a new segment of the map at the last known pose, None where the frame does not hold enough."""
        still = np.zeros(6)
        place = describe_place(view, self._mapper.lens, still, self.timing, self._check.noise)
        if len(place.points) < _LEAST_CORNERS:
            return None
        is_first = self._segment < 0
        self._segment = 1 + max((k.segment for k in self._mapper.map.keyframes), default=-1)
        self._twist = still
        keyframe = self._growth.begin(view, self._T_camera_map, self._segment, self._check)
        self._near = keyframe.number
        self._sight = self._sight.begun(view.stamp)
        T_odom_camera = se3.inverse(self._T_map_odom) @ se3.inverse(self._T_camera_map)
        published = self._causal.begin(view.stamp, self._segment, self._near, T_odom_camera)
        self._previous = Previous(view, None, None, published, keyframe.rows, keyframe.uv)
        state = State.TRACKING if is_first else State.RECOVERED
        reason = "" if is_first else "new segment: no known place recognised"
        return self._estimate(view, state, reason, published, matches=len(keyframe.rows), is_keyframe=True)

    def _estimate(
        self,
        view: View,
        state: State,
        reason: str,
        published: Publication | None,
        *,
        inliers: int = 0,
        matches: int = 0,
        is_keyframe: bool = False,
        is_predicted: bool = False,
        pairwise: RelativePose | None = None,
        features: Features | None = None,
    ) -> Estimate:
        estimate = Estimate(
            sequence=view.frame.sequence,
            stamp=view.stamp,
            state=state,
            reason=reason,
            segment=max(self._segment, 0),
            T_odom_camera=None,
            covariance=None,
            T_map_odom=self._T_map_odom,
            inliers=inliers,
            matches=matches,
            is_keyframe=is_keyframe,
            is_predicted=is_predicted,
            pairwise=pairwise,
            features=features,
        )
        if published is None:
            return estimate
        return replace(
            estimate,
            T_odom_camera=published.T_odom_camera,
            covariance=self._causal.covariance_since_start(published, self._check),
            step=published.step,
            second=published.second,
        )
