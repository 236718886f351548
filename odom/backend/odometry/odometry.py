"""Frames in time order to poses: work that needs no depth is done ahead, work that can wait in the background."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from odom.backend.chain.closed_chain import close_chain
from odom.backend.estimate import ClosedChain, ClosingTest, Estimate, LoopCandidate, OnPose, TrajectoryPose
from odom.backend.loop_closure.closed_walk import closing_test
from odom.backend.map.frame_log import FrameLog
from odom.backend.map.map import Map
from odom.backend.map.memory import take_changes
from odom.backend.map.saved import MapChanges, SavedMap
from odom.backend.map.shown import ShownPath, cloud_of
from odom.backend.mapping.intermediate_frames import IntermediateFrames, corrected
from odom.backend.odometry.between_frames import apply_background, insert_found_corners
from odom.backend.odometry.camera_pixels import in_camera_pixels
from odom.backend.odometry.chain_and_map import extend_chain_and_map
from odom.backend.odometry.final_trajectory import trajectory
from odom.backend.odometry.frame_order import FrameOrder
from odom.backend.odometry.frame_stages import FrameStages
from odom.backend.odometry.next_frame import is_next
from odom.backend.odometry.prepared import Prepared
from odom.backend.odometry.recalibration import Calibrator, Recalibration
from odom.backend.odometry.segmentation import Segmentation, Segmenter
from odom.backend.odometry.unproven_sensor import unproven_sensor
from odom.backend.settings import OdometrySettings
from odom.backend.stopwatch import Stopwatch
from odom.backend.tracking.prediction import predict_pose
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_memory import SensorMemory
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.image_scale import scaled_lens
from odom.frontend.features.images import FrameImages
from odom.frontend.features.view import View
from odom.geometry.arrays import Array, Image

_UNMOVED: Mapping[int, Array] = MappingProxyType({})
"""No poses besides those of the map."""


class Odometry:
    """The odometry of one RGB-D camera: give it frames in order, it returns an estimate for each.

    Deterministic: what runs in the background takes effect at a fixed frame number, never by the clock; time is that
    of the frames' stamps. A frame that cannot be placed has the state LOST; it is not an error. Raises ConfigError for
    images too small to track in, an unknown lens model, or arguments of other types.

    `saved` is a map of earlier runs, `odom.MapFile(path, is_written).begin(camera)`: it is extended, or only used to
    find the camera. A `segmenter` is a function that returns for an `RgbdFrame` the pixels that may move, for example
    people (H x W bool), or None: no landmark lies there. A mask that cannot be right is ignored and counted in
    `segmentation.ignored`. A `calibrator`, such as `odom.MidRunCalibrator()`, may find a better camera during the run:
    the map is then adjusted, published poses continue without a jump, and they stay in the frame of the given camera.
    """

    def __init__(
        self,
        camera: Camera,
        settings: OdometrySettings | None = None,
        saved: SavedMap | None = None,
        segmenter: Segmenter | None = None,
        calibrator: "Calibrator[Odometry] | None" = None,
    ) -> None:
        self.settings = settings or OdometrySettings()
        self.camera = camera
        unproven = unproven_sensor(camera, self.settings)
        sensor = saved.sensor.recalled(unproven) if saved is not None and saved.sensor is not None else unproven
        self._stages = FrameStages(sensor, self.settings, saved)
        self.segmentation = Segmentation(segmenter)
        self.calibrator = calibrator
        self._recalibration = Recalibration(camera, calibrator)
        self._prepared: Prepared | None = None
        self._order = FrameOrder()
        self._path = ShownPath()
        self._adjusted: dict[int, Array] = {}
        self._last_timing: ShutterTiming | None = None
        self.late_loops: tuple[LoopCandidate, ...] = ()
        """The loop candidates that the last `finish` judged, after the last frame."""

    @property
    def camera_in_use(self) -> Camera:
        """The camera that frames are measured by: the one given, until a calibrator finds a better one."""
        return self._recalibration.in_use

    @property
    def timing(self) -> ShutterTiming:
        """The sensor's timing as estimated so far."""
        return self._stages.sensor.timing

    @property
    def sensor(self) -> SensorModel:
        """What the stream has shown of the camera so far."""
        return self._stages.sensor

    @property
    def map(self) -> Map:
        """The map so far: to be read, not changed."""
        return self._stages.map

    @property
    def intermediate(self) -> IntermediateFrames:
        """What some frames between key frames measured: to be read, not changed."""
        return self._stages.mapper.intermediate

    @property
    def frames(self) -> FrameLog:
        """The poses of frames for their middle rows' times, those of the last eight hours: to be read, not changed."""
        return self._stages.published.log

    @property
    def forgotten_keyframes(self) -> int:
        """How many key frames were forgotten, for the map to stay within `map_keyframes`."""
        return len(self._stages.map.forgotten)

    def anticipate(self, stamp: Stamp, color: Image) -> None:
        """Do ahead what needs no depth, for the frame of `stamp` that will hold this same `color` array (grey or RGB).

        The estimate is the same without this, only later: a Kinect's depth comes milliseconds behind its colour.
        """
        stages, last = self._stages, self._stages.last
        if last is None or stages.published.log.is_lost or color.shape[:2] != (self.camera.height, self.camera.width):
            return
        watch, sensor = Stopwatch(), stages.sensor.with_stamp(stamp)
        if not is_next(last.since_s(sensor.clock.steady), sensor.clock.period_s):
            return
        images = FrameImages.of(color)
        watch.lap("images")
        T_predicted = predict_pose(stages.map, last, images, sensor.clock.steady, sensor)
        watch.lap("predict")
        self._prepared = Prepared(stamp, color, images, last, T_predicted, watch.laps_ms)

    def process(self, frame: RgbdFrame, on_pose: OnPose = lambda estimate: None) -> Estimate:
        """Return the estimate for the next frame.

        `on_pose` is given the estimate of a tracked frame as soon as its pose is known, before the chain and the map
        go on. What these and the background add to it is in the returned estimate only.

        Raises InputError for what is no RgbdFrame, a frame whose size is not the camera's, whose stamp is the last
        one's or up to a second before it, or whose stamps stay less than 0.1 ms apart: they are not nanoseconds. A
        stamp further back begins a new time, in which the camera has to be found again.
        """
        stages, log = self._stages, self._stages.published.log
        self._order.check(frame, self.camera, log)
        stages.sensor = stages.sensor.with_stamp(frame.stamp)
        prepared, self._prepared = self._prepared, None
        if prepared is not None and not prepared.is_of(frame, stages.last):
            prepared = None
        watch = Stopwatch(None if prepared is None else prepared.laps_ms)
        images = FrameImages.of(frame.color) if prepared is None else prepared.images
        view = View.of(frame, log.count, stages.sensor.clock, images, self.segmentation.mask(frame))
        watch.lap("images")
        loops, map_moved = self._apply_background(log.count)
        map_moved |= stages.mapper.prune(stages.last)
        watch.lap("background")
        T_predicted = None if prepared is None or map_moved else prepared.T_predicted
        estimate, placed = stages.place(view, T_predicted, watch)
        if placed is not None:
            on_pose(in_camera_pixels(estimate, images.scale))
            estimate = extend_chain_and_map(stages, placed, estimate, watch)
        estimate = in_camera_pixels(estimate, images.scale)
        insert_found_corners(stages, log.count)
        measured = len(self.map.remembered) + len(self.intermediate.kept)
        found = self._recalibration.after_frame(self, measured, log.count, view.steady_stamp)
        if found is not None:
            stages.mapper.lens_to_come = scaled_lens(found, frame_of=self.camera)
        has_time = not estimate.is_keyframe
        loops += stages.closer.work_on_waiting(log.count, stages.sensor, has_time)
        if self._path.is_due(map_moved or estimate.is_keyframe, has_time):
            estimate = replace(estimate, path=self._path.of(stages.map), landmarks_map=cloud_of(stages.map))
        watch.lap("background")
        return replace(estimate, loops=tuple(loops), timings_ms=watch.laps_ms)

    def take_map_changes(self) -> MapChanges:
        """Return what is new or changed in the map since the last call; nothing unless it was opened to be extended."""
        changes = take_changes(self._stages.map)
        return changes if changes.is_empty else replace(changes, sensor=SensorMemory.of(self._stages.sensor))

    def _apply_background(self, count: int | None) -> tuple[list[LoopCandidate], bool]:
        """Take over what the background has done (see `apply_background`), and the new camera if it brings one."""
        lens = self._stages.sensor.lens
        taken = apply_background(self._stages, count)
        if self._stages.sensor.lens is not lens:
            self._recalibration.adopt()
        return taken

    def finish(self) -> tuple[TrajectoryPose, ...]:
        """Return the final corrected trajectory after adjusting the whole map once more.

        It holds one pose for each frame of the last eight hours, at 30 Hz: of some 864,000 frames.
        """
        self.finish_map()
        return self.final_trajectory()

    def finish_map(self) -> None:
        """Adjust the whole map once more, when no frame follows; the last closures are `late_loops`."""
        stages, log, self.late_loops = self._stages, self._stages.published.log, ()
        if stages.last is None:
            return
        insert_found_corners(stages, None)
        newest, tracked = log.count - 1, self._newest_tracked
        if tracked is not None:
            stages.mapper.keep(newest, tracked, stages.sensor)
        loops, _ = self._apply_background(None)
        stages.mapper.start_background(log, stages.sensor)
        self.late_loops = (*loops, *self._apply_background(None)[0])
        T_reference_camera = stages.last.T_reference_camera(stages.map)
        self._last_timing = self.timing
        stages.sensor, self._adjusted = stages.mapper.finish(stages.sensor, log)
        stages.last = stages.last.moved_with(stages.map, T_reference_camera)
        if newest in self._adjusted:
            stages.last = stages.last.at_pose(self._adjusted[newest])

    def final_trajectory(
        self, keyframes: Mapping[int, Array] = _UNMOVED, between: Mapping[int, Array] = _UNMOVED
    ) -> tuple[TrajectoryPose, ...]:
        """Return the trajectory of `finish` once the map is finished, with other poses if they are given.

        They are the T_camera_map of some key frames and of frames `between` them, keyed by number, of the key frame or
        the frame; other frames move along, the map stays as it is. The delays of stamps are those that the last frames
        have shown: what the first ones had measured by a guess of the timing pulls the adjustment's back to that.
        """
        map_, adjusted = self._stages.map, {**self._adjusted, **between}
        moved = [replace(k, T_camera_map=keyframes[k.number]) if k.number in keyframes else k for k in map_.keyframes]
        frames = corrected(self._stages.published.log, moved, adjusted)
        return trajectory(frames, moved, self._last_timing or self.timing)

    def closing_test(self) -> ClosingTest | None:
        """Return the paper's test of a closed walk after `finish`, None where it can't be made (see `closing_test`)."""
        stages = self._stages
        if stages.last is None or self._newest_tracked is None:
            return None
        return closing_test(stages.map, stages.tracker, stages.last, stages.chain.link, stages.sensor)

    def closed_chain(self) -> ClosedChain | None:
        """Return the chain as its loop closures correct it, None where it has not begun."""
        stages = self._stages
        return close_chain(stages.chain, stages.map, stages.sensor)

    @property
    def _newest_tracked(self) -> TrackedFrame | None:
        """The last frame's tracking, None where it was not tracked."""
        last, logged = self._stages.last, self._stages.published.log.last
        return last.tracked if last and logged and logged.stamp == last.view.stamp else None
