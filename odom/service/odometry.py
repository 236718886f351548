"""The odometry process: frames in, poses out, every pose on disk before the next frame begins."""

import logging
import threading
import time
from collections.abc import Callable

from odom.backend import Estimate, Odometry, State
from odom.errors import OdomError, WireError
from odom.frame import Camera
from odom.service.announcer import Announcer
from odom.service.arrivals import Arrival, CameraArrival, ColorArrival, EndArrival, FrameArrival, TruthArrival
from odom.service.files import RunFiles, write_json
from odom.service.intake import Intake
from odom.service.keyframes import keyframe_message
from odom.service.settings import Settings
from odom.service.startup import notify_service_manager, warm_up
from odom.service.tally import Tally, closing_fields
from odom.wire import Topics
from odom.wire.session import WireSession, open_session

_LOG = logging.getLogger(__name__)
_POLL_S = 0.05
_SILENCE_S = 1.0
_LOST_AFTER_S, _LOST_AFTER_PERIODS = 0.12, 2.5


def serve(settings: Settings, files: RunFiles | None, stop: threading.Event, until_end: bool) -> None:
    """Estimate the pose of every frame of one device until `stop` is set, or with `until_end` until its source ends.

    Leaves trajectory.txt and the odometry's part of report.json in the folder of `files` at each end of a source. What
    cannot be written is counted, poses are published all the same. Raises OdomError when the session cannot be opened
    and, with `until_end`, when something went unwritten; OSError when the results cannot be saved at the end.
    """
    topics = Topics(settings.wire.namespace)
    started = time.monotonic()
    warm_up(settings.odometry, topics)
    with open_session(settings.wire) as session:
        process = OdometryProcess(session, topics, settings, files)
        session.announce(topics.alive_of("odometry"))
        notify_service_manager("READY=1")
        _LOG.info("ready after %.1f s, listening on %s", time.monotonic() - started, topics.namespace)
        try:
            process.run(stop, until_end)
        finally:
            notify_service_manager("STOPPING=1")
            process.close()
        if until_end and process.unwritten:
            raise OdomError(f"{process.unwritten} lines or files could not be written: make room, then run it again")


class OdometryProcess:
    """One device's odometry between its intake and its announcer."""

    def __init__(self, session: WireSession, topics: Topics, settings: Settings, files: RunFiles | None) -> None:
        self._topics = topics
        self._settings = settings
        self._files = files
        self._announcer = Announcer(session, topics, settings.service)
        self._intake = Intake(session, topics, settings.service.live_frames)
        self._tally = Tally()
        self._odometry: Odometry | None = None
        self._last: Estimate | None = None
        self._last_at = time.monotonic()
        self._unsaved = False
        self._is_live = False
        self._refused = 0
        self._anticipated_ms = 0.0
        self._sensor = ""
        self._alive = topics.alive
        session.watch(f"{topics.alive}/**", self._watch)

    @property
    def unwritten(self) -> int:
        """Lines and files that the disk did not take."""
        return self._tally.unwritten

    def run(self, stop: threading.Event, until_end: bool) -> None:
        """Process what arrives until told to stop; what has arrived by then is processed still."""
        self._intake.start()
        while not stop.is_set():
            arrival = self._intake.arrivals.take(_POLL_S)
            if arrival is not None:
                self._handle(arrival)
                if until_end and isinstance(arrival, EndArrival):
                    return
            elif self._announcer.status_is_due(self._state):
                self._publish_status()

    def close(self) -> None:
        """Process what still waits and save everything."""
        self._intake.close()
        try:
            for arrival in self._intake.arrivals.drain():
                self._handle(arrival)
        finally:
            self._tell_rest()
            if self._files is not None:
                self._save(self._files)
                self._files.close()

    def _handle(self, arrival: Arrival) -> None:
        if isinstance(arrival, FrameArrival):
            self._process(arrival)
        elif isinstance(arrival, CameraArrival):
            self._calibrate(arrival.camera)
        elif isinstance(arrival, ColorArrival):
            self._anticipate(arrival)
        elif isinstance(arrival, TruthArrival):
            body, pose = arrival.body, arrival.pose
            self._announcer.truth(body, pose)
            self._write(lambda files: files.append_truth(body, pose.stamp, pose.T_parent_child))
        else:
            _LOG.info("the source has ended: %s", arrival.reason)
            self._tell_rest()
            self._write(self._save)

    def _write(self, write: Callable[[RunFiles], None]) -> None:
        """Write, if anything is to be; a disk that is full or gone must not keep back the poses."""
        if self._files is None:
            return
        try:
            write(self._files)
        except OSError as error:
            if not self._tally.unwritten:
                _LOG.error("%s cannot be written (tried again; failures are counted): %s", self._files.folder, error)
            self._tally.unwritten += 1

    def _calibrate(self, camera: Camera) -> None:
        try:
            self._odometry = Odometry(camera, self._settings.odometry)
        except OdomError as error:
            _LOG.error("the calibration is refused, another one may follow: %s", error)
            self._intake.refuse(camera)

    def _anticipate(self, arrival: ColorArrival) -> None:
        if self._odometry is not None:
            begun = time.perf_counter()
            self._odometry.anticipate(arrival.stamp, arrival.color)
            self._anticipated_ms = 1e3 * (time.perf_counter() - begun)

    def _process(self, arrival: FrameArrival) -> None:
        frame, origin = arrival.frame, arrival.origin
        if self._odometry is None:  # its calibration was refused
            self._refused += 1
            return
        self._tally.begin()
        begun = time.perf_counter()
        try:
            estimate = self._odometry.process(frame)
        except OdomError as error:
            if not self._refused:
                _LOG.warning("a frame was refused by the odometry (further ones are counted): %s", error)
            self._refused += 1
            return
        processing_ms = 1e3 * (time.perf_counter() - begun) + self._anticipated_ms
        self._anticipated_ms = 0.0
        self._write(lambda files: files.append(estimate))
        self._announcer.poses(estimate)
        latency_ms = None if origin is None else (time.time_ns() - origin) * 1e-6
        self._tally.add(estimate, frame, processing_ms, latency_ms)
        self._tell_changes(estimate)
        self._last, self._last_at, self._unsaved = estimate, time.monotonic(), True
        self._is_live = origin is not None
        self._announcer.pictures(estimate)
        if estimate.is_keyframe:
            self._show_keyframe(arrival)
        if self._announcer.status_is_due(self._state):
            self._publish_status()

    def _count_forgotten(self, odometry: Odometry) -> None:
        tally = self._tally
        if odometry.forgotten_keyframes and not tally.forgotten_keyframes:
            most = self._settings.odometry.map_keyframes
            _LOG.info("the map holds %d key frames: from now on the oldest are forgotten, and counted", most)
        if odometry.forgotten_frames and not tally.forgotten_frames:
            _LOG.warning("too long for one trajectory.txt: the oldest frames are dropped from it, and counted")
        tally.forgotten_keyframes, tally.forgotten_frames = odometry.forgotten_keyframes, odometry.forgotten_frames

    def _show_keyframe(self, arrival: FrameArrival) -> None:
        color = arrival.color
        if color is None or self._odometry is None:
            return
        camera = self._odometry.camera
        points = self._settings.service.keyframe_points
        try:
            self._announcer.keyframe(lambda: keyframe_message(self._topics, arrival.frame, camera, color, points))
        except WireError as error:
            _LOG.warning("frame %d: no cloud of this key frame: %s", arrival.frame.sequence, error)

    @property
    def _state(self) -> State | None:
        silent_s = time.monotonic() - self._last_at
        if self._last is None or silent_s > _SILENCE_S:
            return None
        period_s = 1.0 / max(self._tally.recent_fps, 1.0)
        is_missed = self._is_live and silent_s > max(_LOST_AFTER_S, _LOST_AFTER_PERIODS * period_s)
        return State.LOST if is_missed else self._last.state

    def _tell_changes(self, estimate: Estimate) -> None:
        before = self._last.state if self._last is not None else None
        if estimate.state is not before and State.LOST in (estimate.state, before):
            _LOG.info("frame %d: %s: %s", estimate.sequence, estimate.state.value, estimate.reason)

    def _publish_status(self) -> None:
        self._count_input()
        last, silent_s = self._last, time.monotonic() - self._last_at
        state = self._state
        is_told = last is not None and state is last.state
        reason = last.reason if last is not None and is_told else f"no frame for {silent_s:.1f} s"
        values = {"state": state.value if state is not None else "WAITING", "reason": reason, "sensor": self._sensor}
        if last is not None:
            values |= {"segment": str(last.segment), "inliers": str(last.inliers), "matches": str(last.matches)}
        self._announcer.status(state, reason, values | self._tally.status())

    def _count_input(self) -> None:
        self._tally.lost_frames = self._intake.lost_frames
        self._tally.unmatched_frames = self._intake.assembler.pairing.color_single
        refused = {"refused by the odometry": self._refused} if self._refused else {}
        self._tally.dropped = self._intake.dropped | refused
        if self._odometry is not None:
            self._count_forgotten(self._odometry)

    def _watch(self, key: str, alive: bool) -> None:
        role = key.removeprefix(self._alive).strip("/") or "sensor"
        if role == "odometry":
            return
        expected = alive or self._intake.source_ended
        _LOG.log(logging.INFO if expected else logging.WARNING, "%s is %s", role, "here" if alive else "gone")
        if role == "sensor":
            self._sensor = "here" if alive else "gone"

    def _tell_rest(self) -> None:
        self._announcer.flush()
        self._publish_status()

    def _save(self, files: RunFiles) -> None:
        """Write the final trajectory and the report, unless nothing came since they were last written."""
        if not self._unsaved or self._odometry is None:
            return
        begun = time.perf_counter()
        files.write_trajectory(self._odometry.finish())
        self._tally.add_loops(self._odometry.late_loops)
        self._announcer.loops(self._odometry.late_loops)
        report = self._tally.report() | {
            "finish_s": round(time.perf_counter() - begun, 3),
            "closing": closing_fields(self._odometry.closing_test()),
        }
        write_json(files.folder / "report.json", report)
        self._unsaved = False
