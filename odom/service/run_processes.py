"""The child processes of one `odom run`: in which order they start and end, and which the run can do without."""

import json
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from odom.errors import WireError
from odom.service.child_process import ChildProcess
from odom.service.evaluation_imports import EvaluationImports
from odom.service.progress import COUNT_ENVIRONMENT, Display, Reading, parse_count, parse_report
from odom.service.run_folder import HELD_ENVIRONMENT
from odom.service.settings import Settings
from odom.service.stand_in import StandIn
from odom.wire import Topics, codec
from odom.wire.idle_detector import IdleDetector
from odom.wire.session import Delivery, WireSession
from odom.wire.settings import ANY_LOCAL_PORT

_POLL_S = 0.1
"""Longest wait for a status: a failed process or Ctrl-C is noticed this late."""
_END_POLL_S = 0.01
"""The same once the sensor has ended and the odometry soon will: longer delays the end of a run."""
_LAST_WORDS_S = 3.0
"""Time for sensor and recorder to end by themselves after the last frame; shorter would cut off their last messages."""
_VIEWER_PATIENCE_S = 10.0
"""A viewer that hangs must not delay the end; by then it has written its file."""
_DISPENSABLE = ("viewer", "recorder")
"""Child processes that may fail while poses go on."""


@dataclass(frozen=True)
class RunPlan:
    """What to start: arguments of sensor, odometry and viewer (None: no viewer), and where files go.

    The sensor skips the first `start` seconds of the source.
    With `overwrite` the file of `record` may be replaced. With `stay` the viewer is kept open after the end of the
    source. With `remember` the calibration that the run finds is kept for the device's next runs.
    """

    source: str
    out: Path
    camera: Path | None = None
    start: float = 0.0
    sensor_arguments: Sequence[str] = ()
    odometry_arguments: Sequence[str] = ()
    record: Path | None = None
    overwrite: bool = False
    viewer_arguments: Sequence[str] | None = None
    stay: bool = False
    remember: bool = False

    @property
    def viewer_writes(self) -> bool:
        """Whether the viewer is to write a file."""
        return any(argument.startswith("--rrd") for argument in self.viewer_arguments or ())


class RunProcesses:
    """The child processes of one run, and the order in which they are started and ended.

    `total` is how many colour images the sensor says its source has, `reports` the reports that sensor (see
    `input_report`) and odometry printed at their ends, `counts` the frames of the odometry's last status.
    `was_stopped`: the run was asked to stop before the source had ended. `folder_lock` is the descriptor of the lock
    that the odometry shares.
    """

    def __init__(
        self,
        plan: RunPlan,
        settings: Settings,
        endpoint: str,
        session: WireSession,
        display: Display,
        folder_lock: int | None = None,
    ) -> None:
        topics = Topics(settings.wire.namespace)
        self.total: int | None = None
        self.reports: dict[str, dict[str, Any] | None] = {"sensor": None, "odometry": None}
        self.counts = {"frames": 0, "tracked": 0}
        self._plan = plan
        self._display = display
        self._reported: set[str] = set()
        self.was_stopped = False
        self._frames = -1
        self._sensor_is_here = False
        self._odometry_idles = IdleDetector()
        self._patience_s = settings.service.stop_timeout_s
        self._status = session.subscriber((topics.status,), depth=1)
        self._stand_in = StandIn(session, topics.ack_of("recorder"))
        environment = {
            "ODOM_WIRE__MODE": "peer",
            "ODOM_WIRE__CONNECT": json.dumps([endpoint]),
            "ODOM_WIRE__LISTEN": json.dumps([ANY_LOCAL_PORT]),
            "ODOM_WIRE__NAMESPACE": settings.wire.namespace,
            COUNT_ENVIRONMENT: "1",
        }
        if settings.wire.ros2_domain is not None:
            environment["ODOM_WIRE__ROS2_DOMAIN"] = str(settings.wire.ros2_domain)
        shared = {} if folder_lock is None else {HELD_ENVIRONMENT: str(folder_lock)}
        self.children: dict[str, ChildProcess] = {}
        for name, arguments in _commands(plan):
            extra, given = (shared, (folder_lock,)) if name == "odometry" and folder_lock is not None else ({}, ())
            self.children[name] = ChildProcess(name, arguments, environment | extra, self._read_line, given)
        self._evaluation = EvaluationImports(plan.out, expected=plan.source == "arena" or Path(plan.source).exists())

    @property
    def failed(self) -> list[ChildProcess]:
        """The children that have ended otherwise than they should."""
        return [child for child in self.children.values() if child.failed and not self._has_nothing_to_record(child)]

    @property
    def failures(self) -> list[ChildProcess]:
        """Those of them that left work undone; a viewer does so only when it was to write a file."""
        return [child for child in self.failed if child.name != "viewer" or self._plan.viewer_writes]

    def work(self, stop: threading.Event) -> None:
        """Wait for the end of the source or until `stop` is set.

        A failed sensor or odometry ends the work; without viewer and recorder it goes on. An odometry that has missed
        the end of a live source, and has reported no new frame for five seconds, is asked to end.
        """
        sensor, odometry = self.children["sensor"], self.children["odometry"]
        while odometry.status is None and not stop.is_set() and all(c.name in _DISPENSABLE for c in self.failed):
            for child in self.children.values():
                child.poll()
            self._show_progress()
            self._report_failures()
            if self._end_is_lost():
                self._display.say("run", "the odometry has not heard that the sensor has ended; saving what was done")
                odometry.stop(self._patience_s)
        self._report_failures()
        if stop.is_set():
            self.was_stopped = True
            sensor.stop(self._patience_s)
            odometry.stop(self._patience_s)
        elif odometry.status == 0:
            sensor.wait(_LAST_WORDS_S)

    def keep_viewer(self, stop: threading.Event) -> None:
        """Wait until `stop` is set or the viewer is closed."""
        viewer = self.children.get("viewer")
        if viewer is not None and viewer.poll() is None:
            self._display.say("run", "the source has ended; Ctrl-C closes the viewer")
            while viewer.poll() is None and not stop.wait(_POLL_S):
                continue

    def end_work(self) -> None:
        """End all but the viewer, first those for which others wait; the recorder ends after the last pose."""
        for name in ("sensor", "odometry", "recorder"):
            child = self.children.get(name)
            if child is not None and not (name == "recorder" and child.wait(_LAST_WORDS_S)):
                child.stop(self._patience_s)
        self._stand_in.leave()

    def end_viewer(self) -> None:
        """End the viewer."""
        if (viewer := self.children.get("viewer")) is not None:
            viewer.stop(min(self._patience_s, _VIEWER_PATIENCE_S))
        self._report_failures()

    def _has_nothing_to_record(self, child: ChildProcess) -> bool:
        """Return whether it is a recorder that has no file since the run was stopped before the first frame."""
        frames = (self.reports["odometry"] or self.counts).get("frames")
        return child.name == "recorder" and self.was_stopped and not frames and child.name not in self._reported

    def _report_failures(self) -> None:
        recorder = self.children.get("recorder")
        if recorder is not None and recorder.failed:
            self._stand_in.step(both_are_here=self._sensor_is_here and self._frames >= 0)
        for child in self.failed:
            if child.name not in self._reported:
                self._reported.add(child.name)
                then = "the run goes on without it" if child.name in _DISPENSABLE else "saving what was done so far"
                self._display.say("run", f"the {child.name} {child.ending()}; {then}")
                if child is recorder and self._plan.record:
                    self._say_what_is_left(self._plan.record)

    def _say_what_is_left(self, recording: Path) -> None:
        from odom.wire.recording.part_file import how_to_save, newest_part

        if (part := newest_part(recording)) is not None:
            self._display.say("run", how_to_save(part))

    def _read_line(self, name: str, line: str) -> None:
        count, report = parse_count(line), parse_report(line)
        if report is not None and name in self.reports:
            self.reports[name] = report
        elif count is None:
            self._display.say(name, line)
        elif name == "sensor":
            self._sensor_is_here, self.total = True, count[1]

    def _show_progress(self) -> None:
        if self._sensor_is_here:
            self._evaluation.begin_if_due()
        has_ended = self.children["sensor"].status is not None
        delivery = self._status.receive(timeout=_END_POLL_S if has_ended else _POLL_S)
        reading = self._reading(delivery) if delivery is not None else None
        if reading is not None:
            self._display.show(reading)
            self._count_report(reading.frames)

    def _count_report(self, frames: int) -> None:
        """Count status messages without a new frame after the sensor's end; while the odometry saves it sends none."""
        if frames != self._frames or self.children["sensor"].status is None:
            self._odometry_idles.note_work()
        self._frames = frames
        self._odometry_idles.note_report()

    def _end_is_lost(self) -> bool:
        return self._odometry_idles.is_idle and self.children["sensor"].status == 0

    def _reading(self, delivery: Delivery) -> Reading | None:
        try:
            values = codec.decode_status(delivery.message)[0].values
            self.counts = {name: int(values.get(name, 0)) for name in ("frames", "tracked")}
            return Reading(
                self.counts["frames"],
                self.total,
                float(values.get("fps", 0.0)),
                values["state"],
                values.get("reason", ""),
            )
        except (WireError, LookupError, ValueError) as error:
            self._status.malformed.add(delivery.message.topic, repr(error))
            return None


def _commands(plan: RunPlan) -> list[tuple[str, Sequence[str]]]:
    consumers = 1 + (plan.record is not None)
    odometry = ["serve", "--out", str(plan.out), "--until-end", *plan.odometry_arguments]
    commands: list[tuple[str, Sequence[str]]] = [("odometry", odometry)]
    if plan.record is not None:
        commands.append(("recorder", ["record", *(["--overwrite"] if plan.overwrite else []), "--", str(plan.record)]))
    if plan.viewer_arguments is not None:
        commands.append(("viewer", ["view", *plan.viewer_arguments]))
    sensor = ["sensor", "--consumers", str(consumers), *plan.sensor_arguments, "--", plan.source]
    return [*commands, ("sensor", sensor)]
