"""The odometry process: frames in, poses out, every pose on disk before the next frame begins."""

import logging
import threading
import time
from collections.abc import Callable
from functools import partial

from odom.backend import Estimate, Odometry, State
from odom.errors import OdomError, WireError
from odom.frame import Camera, Stamp
from odom.frontend.matching.moving_surfaces import MovingCells
from odom.service.arrival_queue import Arrival, CameraArrival, ColorArrival, EndArrival, FrameArrival, TruthArrival
from odom.service.change_log import ChangeLog
from odom.service.estimate_messages import keyframe_message, status_values
from odom.service.estimate_publisher import EstimatePublisher
from odom.service.final_results import save_results
from odom.service.frame_receiver import FrameReceiver
from odom.service.map_keeper import MapKeeper
from odom.service.mask_file import masked_by
from odom.service.other_processes import OtherProcesses
from odom.service.result_files import RunFiles
from odom.service.run_calibration import calibration_status, calibrator_for
from odom.service.run_statistics import RunStatistics
from odom.service.settings import Settings
from odom.service.silence import state_after
from odom.service.startup import notify_service_manager, warm_up
from odom.wire import Topics
from odom.wire.image_counts import NOT_TRACKABLE
from odom.wire.publisher import Mirror
from odom.wire.ros2 import join_ros2
from odom.wire.session import WireSession, open_session

_LOG = logging.getLogger(__name__)
_POLL_S = 0.05
"""Longest wait for an arrival; a due status or the request to stop is noticed this late."""


def serve(
    settings: Settings, files: RunFiles | None, stop: threading.Event, until_end: bool, keeper: MapKeeper
) -> None:
    """Estimate the pose of every frame of one device until `stop` is set, or with `until_end` until its source ends.

    Leaves trajectory.txt and the odometry's part of report.json in the folder of `files` at each end of a source. What
    cannot be written is counted, and poses go on; the `keeper` writes the map. Raises OdomError without a session and,
    with `until_end`, when something went unwritten; OSError when results cannot be saved.
    """
    topics = Topics(settings.wire.namespace)
    started = time.monotonic()
    calibration_ready = warm_up(settings.odometry, topics, stop)
    if stop.is_set():
        return
    with open_session(settings.wire) as session:
        mirror = join_ros2(session, settings.wire, "odometry")
        process = OdometryProcess(session, topics, settings, files, keeper, calibration_ready, mirror)
        session.announce(topics.alive_of("odometry"))
        notify_service_manager("READY=1")
        _LOG.info("ready after %.1f s, listening on %s", time.monotonic() - started, topics.namespace)
        try:
            process.run(stop, until_end)
        finally:
            notify_service_manager("STOPPING=1")
            process.close()
        if until_end and (unwritten := process.statistics.unwritten):
            raise OdomError(f"{unwritten} lines, files or changes of the map are not written: make room, run it again")


class OdometryProcess:
    """One device's odometry, from the receiver's frames to published and written poses."""

    def __init__(
        self,
        session: WireSession,
        topics: Topics,
        settings: Settings,
        files: RunFiles | None,
        keeper: MapKeeper,
        calibration_ready: threading.Event,
        mirror: Mirror | None = None,
    ) -> None:
        self._topics, self._settings = topics, settings
        self._files, self._keeper, self._calibration_ready = files, keeper, calibration_ready
        self._publisher = EstimatePublisher(session, topics, settings.service, mirror)
        self._receiver = FrameReceiver(session, topics, settings.service.live_frames)
        self.statistics = RunStatistics()
        self._odometry: Odometry | None = None
        self._last: Estimate | None = None
        self._last_at = time.monotonic()
        self._unsaved = self._is_live = False
        self._change_log = ChangeLog()
        self._anticipated_ms, self._published_sequence = 0.0, -1
        self._others = OtherProcesses(session, topics, self._receiver)

    def run(self, stop: threading.Event, until_end: bool) -> None:
        """Process what arrives until `stop` is set or, with `until_end`, the source has ended."""
        self._receiver.start(until_end)
        while not stop.is_set():
            arrival = self._receiver.arrivals.take(_POLL_S)
            if arrival is not None:
                self._handle(arrival)
                if until_end and isinstance(arrival, EndArrival):
                    return
            elif self._publisher.status_is_due(self._state):
                self._publish_status()

    def close(self) -> None:
        """Process what has arrived and still waits, then save everything."""
        self._receiver.close()
        try:
            for arrival in self._receiver.arrivals.drain():
                self._handle(arrival)
        finally:
            self._publish_rest()
            if self._files is not None:
                self._save(self._files)
                self._files.close()
            elif self._odometry is not None:
                self._odometry.finish_map()
                self._keeper.save(self._odometry)

    def _handle(self, arrival: Arrival) -> None:
        if isinstance(arrival, FrameArrival):
            self._process(arrival)
        elif isinstance(arrival, CameraArrival):
            self._begin_odometry(arrival.camera)
        elif isinstance(arrival, ColorArrival):
            self._anticipate(arrival)
        elif isinstance(arrival, TruthArrival):
            body, pose = arrival.body, arrival.pose
            self._publisher.remember_truth(body, pose)
            self._write(lambda files: files.append_truth(body, pose.stamp, pose.T_parent_child))
        else:
            _LOG.info("the source has ended: %s", arrival.reason)
            self.statistics.source_end = arrival.reason
            self._publish_rest()
            self._write(self._save)

    def _write(self, write: Callable[[RunFiles], None]) -> None:
        """Write to the files, if there are any; a full or missing disk must not hold back the poses."""
        if self._files is None:
            return
        try:
            write(self._files)
        except OSError as error:
            if not self.statistics.unwritten_lines:
                _LOG.error("%s cannot be written (tried again; failures are counted): %s", self._files.folder, error)
            self.statistics.unwritten_lines += 1

    def _begin_odometry(self, camera: Camera) -> None:
        saved = self._keeper.begin(camera, self._odometry)
        try:
            settings, has_map, mask = self._settings.odometry, self._keeper.has_map, self._settings.service.mask
            calibrator = calibrator_for(settings, has_map, self._calibration_ready, lambda: not self._is_live)
            self._odometry = Odometry(camera, settings, saved, masked_by(mask, camera), calibrator)
        except OdomError as error:
            _LOG.error("the calibration is refused, another one may follow: %s", error)
            self._receiver.refuse(camera)

    def _anticipate(self, arrival: ColorArrival) -> None:
        if self._odometry is not None:
            begun = time.perf_counter()
            self._odometry.anticipate(arrival.stamp, arrival.color)
            self._anticipated_ms = 1e3 * (time.perf_counter() - begun)

    def _process(self, arrival: FrameArrival) -> None:
        frame, origin = arrival.frame, arrival.origin
        if self._odometry is None:  # its calibration was refused
            self.statistics.refused += 1
            return
        self._is_live = origin is not None
        self.statistics.begin()
        begun = time.perf_counter()
        try:
            estimate = self._odometry.process(frame, lambda estimate: self._publish_pose(estimate, origin))
        except WireError:  # its pose could not be published: the frame is not to blame
            raise
        except OdomError as error:
            if not self.statistics.refused:
                _LOG.warning("a frame was refused by the odometry (further ones are counted): %s", error)
            self.statistics.refused += 1
            return
        processing_ms = 1e3 * (time.perf_counter() - begun) + self._anticipated_ms
        self._anticipated_ms = 0.0
        self._write(lambda files: files.append(estimate))
        if estimate.sequence != self._published_sequence:
            self._publish_pose(estimate, origin)
        self._publisher.publish_chain(estimate)
        self._publisher.publish_loops(estimate.loops)
        self._keeper.note(self._odometry, frame.stamp)
        self.statistics.add(estimate, frame, processing_ms)
        self._change_log.note(self._odometry, self._last, estimate)
        self._last, self._last_at, self._unsaved = estimate, time.monotonic(), True
        self._publisher.publish_display(estimate)
        if estimate.is_keyframe:
            self._show_keyframe(arrival, estimate.moving)
        if self._publisher.status_is_due(self._state):
            self._publish_status()

    def _publish_pose(self, estimate: Estimate, origin: Stamp | None) -> None:
        self._publisher.publish_pose(estimate)
        self._published_sequence = estimate.sequence
        if origin is not None:
            self.statistics.latency.add((time.time_ns() - origin) * 1e-6)

    def _show_keyframe(self, arrival: FrameArrival, moving: MovingCells | None) -> None:
        color, frame, points = arrival.color, arrival.frame, self._settings.service.keyframe_points
        if color is None or self._odometry is None:
            return
        cloud = partial(keyframe_message, self._topics, frame, self._odometry.camera, color, points, moving)
        try:
            self._publisher.publish_keyframe(cloud)
        except WireError as error:
            _LOG.warning("frame %d: no cloud of this key frame: %s", frame.sequence, error)

    @property
    def _state(self) -> State | None:
        last = None if self._last is None else self._last.state
        return state_after(last, time.monotonic() - self._last_at, self._is_live, self.statistics.recent_fps)

    def _publish_status(self) -> None:
        self._update_counts()
        last, state = self._last, self._state
        silent = f"no frame for {time.monotonic() - self._last_at:.1f} s"
        reason = last.reason if last is not None and state is last.state else silent
        values = {"state": state.value if state is not None else "WAITING", "reason": reason}
        values |= {} if last is None else status_values(last)
        values |= {} if self._odometry is None else calibration_status(self._odometry)
        self._publisher.publish_status(state, reason, values | self._others.status() | self.statistics.status())

    def _update_counts(self) -> None:
        counts = self.statistics
        counts.unwritten_changes = self._keeper.unwritten
        counts.lost_frames, counts.unmatched_frames = self._receiver.lost_frames, self._receiver.unmatched_frames
        counts.color, counts.depth = self._receiver.color, self._receiver.depth
        counts.dropped = self._receiver.dropped | ({NOT_TRACKABLE: counts.refused} if counts.refused else {})
        if self._odometry is None:
            return
        gone = self._odometry.forgotten_keyframes, self._odometry.frames.dropped
        counts.note_forgotten(*gone, self._settings.odometry.map_keyframes)

    def _publish_rest(self) -> None:
        self._publisher.flush()
        self._publish_status()

    def _save(self, files: RunFiles) -> None:
        """Write the final trajectory and the report, unless nothing came since they were last written."""
        if not self._unsaved or self._odometry is None:
            return
        save_results(self._odometry, files, self._keeper, self._publisher, self.statistics)
        self._unsaved = False
