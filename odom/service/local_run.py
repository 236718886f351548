"""`odom run`: the processes of one machine, from the first frame of a source to its report."""

import json
import logging
import socket
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from odom.errors import ConfigError, OdomError, WireError
from odom.service import previous_results
from odom.service.child_process import ChildProcess
from odom.service.progress import COUNT_ENVIRONMENT, Display, Reading, open_display, parse_count
from odom.service.result_files import write_json
from odom.service.settings import Settings
from odom.wire import Topics, codec
from odom.wire.idle_detector import IdleDetector
from odom.wire.session import Delivery, WireSession, open_session
from odom.wire.settings import ANY_LOCAL_PORT

_LOG = logging.getLogger(__name__)
_POLL_S = 0.1
"""Longest wait for a status: so late a failed process or Ctrl-C is noticed."""
_CALLED_WRONGLY = 2
"""Exit status of a command that was called wrongly."""
_LAST_WORDS_S = 3.0
"""For sensor and recorder to end by themselves behind the last frame; shorter would cut off their last messages."""
_VIEWER_PATIENCE_S = 10.0
"""A viewer that hangs must not hold the report back; what it writes, it has written by then."""


@dataclass(frozen=True)
class RunPlan:
    """What to start: arguments of sensor, odometry and viewer (None: no viewer), and where files go.

    With `stay` the viewer is kept open after the end of the source; with `log_json` progress is logged as JSON.
    """

    source: str
    out: Path
    sensor_arguments: Sequence[str] = ()
    odometry_arguments: Sequence[str] = ()
    record: Path | None = None
    viewer_arguments: Sequence[str] | None = None
    stay: bool = False
    log_json: bool = False


def run(plan: RunPlan, settings: Settings, stop: threading.Event) -> dict[str, Any]:
    """Run the source to its end, or until `stop` is set, and return the report that was written to `plan.out`.

    Results of an earlier run there are removed first: when this one ends at once, they would be taken for its own.
    Raises OdomError naming the processes that failed, at work or at their end, ConfigError when the first of them was
    called wrongly; OdomError, too, when no frame was processed. What was done is saved by then, with its report.
    """
    plan.out.mkdir(parents=True, exist_ok=True)
    previous_results.remove(plan.out)
    previous_results.remove_shown(plan.out)
    endpoint = free_endpoint()
    wire = settings.wire.model_copy(update={"mode": "peer", "connect": (), "listen": (endpoint,)})
    begun = time.monotonic()
    with open_session(wire) as session, open_display(plan.log_json) as display:
        display.say("run", f"to watch it: {watching(endpoint, wire.namespace)}")
        processes = RunProcesses(plan, settings, endpoint, session, display)
        try:
            processes.work(stop)
            if plan.stay and not processes.failed:
                processes.keep_viewer(stop)
        finally:
            processes.end_all()
    report = complete_report(plan.out, processes, time.monotonic() - begun)
    if failed := processes.failed:
        error = ConfigError if failed[0].status == _CALLED_WRONGLY else OdomError
        endings = ", ".join(f"the {child.name} {child.ending()}" for child in failed)
        raise error(f"{endings}; what was done so far is in {plan.out}")
    if not report.get("frames"):
        why = "the run was stopped before the first" if stop.is_set() else f"`odom doctor {plan.source}` may say why"
        raise OdomError(f"no frame was processed: {why}")
    return report


def watching(endpoint: str, namespace: str) -> str:
    """Return the command line that opens another viewer of the run on this machine."""
    device = "" if namespace == Topics().namespace else f" --namespace {namespace}"
    return f"odom view --connect {endpoint}{device}"


def free_endpoint() -> str:
    """Return a free loopback endpoint: two runs on one machine do not mix."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


class RunProcesses:
    """The child processes of one run, and the order in which they are started and ended."""

    def __init__(
        self, plan: RunPlan, settings: Settings, endpoint: str, session: WireSession, display: Display
    ) -> None:
        topics = Topics(settings.wire.namespace)
        self.total: int | None = None
        self._display = display
        self._reported: set[str] = set()
        self._frames = -1
        self._odometry_idles = IdleDetector()
        self._patience_s = settings.service.stop_timeout_s
        self._status = session.subscriber((topics.status,), depth=1)
        environment = {
            "ODOM_WIRE__MODE": "peer",
            "ODOM_WIRE__CONNECT": json.dumps([endpoint]),
            "ODOM_WIRE__LISTEN": json.dumps([ANY_LOCAL_PORT]),
            "ODOM_WIRE__NAMESPACE": settings.wire.namespace,
            COUNT_ENVIRONMENT: "1",
        }
        self.children = {name: self._start(name, arguments, environment) for name, arguments in _commands(plan)}

    @property
    def failed(self) -> list[ChildProcess]:
        """The children that have ended otherwise than they should."""
        return [child for child in self.children.values() if child.failed]

    def work(self, stop: threading.Event) -> None:
        """Wait for the end of the source or until `stop` is set.

        A failed sensor, odometry or recorder ends the work; without its viewer it goes on. An odometry that
        has missed the end of a live source, and has reported no new frame for five seconds, is asked to end.
        """
        sensor, odometry = self.children["sensor"], self.children["odometry"]
        while odometry.poll() is None and not stop.is_set() and all(c.name == "viewer" for c in self.failed):
            self._show_progress()
            self._report_failures()
            if self._end_is_lost():
                self._display.say("run", "the odometry has not heard that the sensor has ended; saving what was done")
                odometry.stop(self._patience_s)
        self._report_failures()
        if stop.is_set():
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

    def end_all(self) -> None:
        """End all children, those first for whose end others wait; the recorder ends by itself after the last pose."""
        for name in ("sensor", "odometry", "recorder", "viewer"):
            child = self.children.get(name)
            if child is not None and not (name == "recorder" and child.wait(_LAST_WORDS_S)):
                child.stop(min(self._patience_s, _VIEWER_PATIENCE_S) if name == "viewer" else self._patience_s)

    def _start(self, name: str, arguments: Sequence[str], environment: Mapping[str, str]) -> ChildProcess:
        return ChildProcess(name, arguments, environment, self._read_line)

    def _report_failures(self) -> None:
        for child in self.failed:
            if child.name not in self._reported:
                self._reported.add(child.name)
                then = "the run goes on without it" if child.name == "viewer" else "saving what was done so far"
                self._display.say("run", f"the {child.name} {child.ending()}; {then}")

    def _read_line(self, name: str, line: str) -> None:
        count = parse_count(line)
        if count is None:
            self._display.say(name, line)
        elif name == "sensor":
            self.total = count[1]

    def _show_progress(self) -> None:
        delivery = self._status.receive(timeout=_POLL_S)
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
            return Reading(
                int(values.get("frames", 0)),
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
        commands.append(("recorder", ["record", str(plan.record)]))
    if plan.viewer_arguments is not None:
        commands.append(("viewer", ["view", *plan.viewer_arguments]))
    sensor = ["sensor", plan.source, "--consumers", str(consumers), *plan.sensor_arguments]
    return [*commands, ("sensor", sensor)]


def complete_report(out: Path, processes: RunProcesses, elapsed_s: float) -> dict[str, Any]:
    """Add memory, total time and the errors against truth to the odometry's report, and write it again."""
    path = out / "report.json"
    report: dict[str, Any] = json.loads(path.read_text()) if path.is_file() else {}
    children = processes.children.values()
    peaks = {child.name: round(child.peak_rss_mb, 1) for child in children}
    report["peak_rss_mb"] = {"sensor": None, "odometry": None, "viewer": None} | peaks
    report["cpu_s"] = {child.name: round(child.cpu_s, 2) for child in children}
    report["elapsed_s"] = round(elapsed_s, 2)
    if (out / "truth.txt").is_file() and (out / "trajectory.txt").is_file():
        from odom.evaluation.run_report import report_with_truth

        try:
            report |= report_with_truth(out, total_frames=processes.total)
        except OdomError as error:
            report["truth_notes"] = [str(error)]
            _LOG.warning("not judged against truth: %s", error)
    write_json(path, report)
    return report
