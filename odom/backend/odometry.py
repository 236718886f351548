"""Frames in order of time to poses: what needs no depth is done ahead, what can wait is done beside."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.backend.estimate import ClosingTest, Estimate, LoopCandidate, TrajectoryPose
from odom.backend.settings import OdometrySettings
from odom.backend.sight import LEAP_S
from odom.backend.stopwatch import Stopwatch
from odom.backend.walk import Walk
from odom.backend.whereabouts import Previous
from odom.errors import ConfigError, InputError
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.clock import Clock
from odom.frontend.images import FrameImages
from odom.frontend.timing import Timing
from odom.frontend.view import View

Array = NDArray[np.float64]

_LEAST_SIDE_PX = 64


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
        self._walk = Walk(camera, self.settings)
        self._clock = Clock()
        self._glance: _Glance | None = None
        self.late_loops: tuple[LoopCandidate, ...] = ()
        """What the last `finish` judged, after the last frame."""

    @property
    def timing(self) -> Timing:
        """The sensor's timing as estimated so far."""
        return self._walk.mapper.timing

    @property
    def forgotten_keyframes(self) -> int:
        """How many key frames were forgotten, for the map to stay within `map_keyframes`."""
        return self._walk.mapper.forgotten

    @property
    def forgotten_frames(self) -> int:
        """How many frames were dropped from the final trajectory: those older than the last eight hours."""
        return self._walk.causal.frames.dropped

    def anticipate(self, stamp: Stamp, color: NDArray[np.uint8]) -> None:
        """Do already what needs no depth, for the frame that will hold this very `color` (grey or RGB) of `stamp`.

        The estimates are the same with and without, but sooner: a Kinect's depth comes milliseconds behind its colour.
        """
        walk, previous = self._walk, self._walk.previous
        if previous is None or walk.causal.is_lost or color.shape[:2] != previous.view.images.full.shape:
            return
        watch = Stopwatch()
        images = FrameImages.of(color)
        watch.lap("images")
        T_coarse = walk.follow_coarsely(images, self._clock.after(stamp).steady)
        watch.lap("follow")
        self._glance = _Glance(color, images, previous, T_coarse, watch.laps_ms)

    def process(self, frame: RgbdFrame) -> Estimate:
        """Return the estimate for the next frame.

        Raises InputError for a frame whose size is not the camera's, or whose stamp is the last one's or up to a
        second before it; a leap further back is a new time, in which the camera has to be found again.
        """
        if frame.depth_mm.shape != (self.camera.height, self.camera.width):
            raise InputError(
                f"a frame of {frame.depth_mm.shape[::-1]} pixels from {self.camera}: give that camera's own"
            )
        if -LEAP_S <= self._walk.causal.since_last_s(frame.stamp) <= 0.0:
            raise InputError(f"frame {frame.sequence} is not later than the one before: give frames in order of time")
        self._clock = self._clock.after(frame.stamp)
        glance, self._glance = self._glance, None
        if glance is not None and (glance.color is not frame.color or glance.previous is not self._walk.previous):
            glance = None
        watch = Stopwatch(None if glance is None else glance.laps_ms)
        images = FrameImages.of(frame.color) if glance is None else glance.images
        view = View.of(frame, self._clock, images)
        watch.lap("images")
        loops, map_moved = self._walk.take_background(self._walk.causal.frames.count)
        map_moved |= self._walk.forget()
        watch.lap("background")
        T_coarse = None if glance is None or map_moved else glance.T_coarse
        estimate = self._walk.step(view, self._clock, T_coarse, watch)
        if map_moved or estimate.is_keyframe:
            map_ = self._walk.mapper.map
            estimate = replace(estimate, path=map_.path(), landmarks_map=map_.cloud())
        return replace(estimate, loops=loops, timings_ms=watch.laps_ms)

    def finish(self) -> tuple[TrajectoryPose, ...]:
        """Return the final corrected trajectory after adjusting the whole map once more.

        It holds one pose a frame, of the last eight hours (see `PlacedFrames`).
        """
        poses, self.late_loops = self._walk.finish()
        return poses

    def closing_test(self) -> ClosingTest | None:
        """Return the paper's test of a closed walk after `finish`, None where it can't be made (see `closing_test`)."""
        return self._walk.closing_test()
