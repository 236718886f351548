"""The order in which the processes of one run come and go, with children that only pretend."""

import errno
import json
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from itertools import count, repeat
from pathlib import Path
from shutil import rmtree
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest

from odom.cli.summary import summary
from odom.errors import OdomError
from odom.frame import Stamp
from odom.service.local_run import run
from odom.service.run_processes import RunPlan, RunProcesses
from odom.service.settings import Settings
from odom.service.stand_in import StandIn
from odom.wire import Topics
from odom.wire.codec import Status, encode_status
from odom.wire.session import Delivery

Says = Callable[[str, str], None]


class PretendedChild:
    """Ends with status 0 when it is asked to."""

    peak_rss_mb, cpu_s = 1.0, 0.1

    def __init__(self, name: str, arguments: object, environment: object, say: Says, held: object) -> None:
        self.name = name
        self.status: int | None = None
        self.failed = False

    def poll(self) -> int | None:
        return self.status

    def wait(self, timeout_s: float) -> bool:
        return self.status is not None

    def stop(self, timeout_s: float) -> None:
        self.status = 0 if self.status is None else self.status


@pytest.mark.process
def test_a_run_stopped_at_once_does_not_pass_off_the_results_before_it_as_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("odom.service.run_processes.ChildProcess", PretendedChild)
    (tmp_path / "report.json").write_text(json.dumps({"frames": 5}))
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "session.rrd").write_bytes(b"shown then")
    stop = threading.Event()
    stop.set()
    with pytest.raises(OdomError, match="stopped before the first"):
        run(RunPlan("arena", tmp_path), Settings(), stop, print)
    assert json.loads((tmp_path / "report.json").read_text())["frames"] == 0
    assert (tmp_path / "notes.txt").exists()
    assert not (tmp_path / "session.rrd").exists()
    assert [path.read_bytes() for path in tmp_path.glob("until-*/session.rrd")] == [b"shown then"]


class DoneChild(PretendedChild):
    """An odometry that has done five frames and ended; all others end when asked to."""

    def __init__(self, name: str, arguments: object, environment: object, say: Says, held: object) -> None:
        super().__init__(name, arguments, environment, say, held)
        if name == "odometry":
            say(name, '@report {"frames": 5, "tracked": 4}')
            self.status = 0


class KilledViewer(DoneChild):
    """Beside it a viewer that was killed."""

    def __init__(self, name: str, arguments: object, environment: object, say: Says, held: object) -> None:
        super().__init__(name, arguments, environment, say, held)
        if name == "viewer":
            self.failed, self.status = True, -9

    def ending(self) -> str:
        return "was killed by SIGKILL"


@pytest.mark.process
def test_the_report_is_told_before_a_viewer_that_stays_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("odom.service.run_processes.ChildProcess", DoneChild)
    stop, told = threading.Event(), []

    def tell(report: dict[str, Any]) -> None:
        told.append(report)
        stop.set()  # which ends the waiting for the viewer

    run(RunPlan("arena", tmp_path, viewer_arguments=["--web"], stay=True), Settings(), stop, tell)
    assert [report["tracked"] for report in told] == [4]


class RecorderOfNothing(PretendedChild):
    """Beside children that end as asked a recorder that has failed, at once or when it is asked to end."""

    fails_at_once = False

    def __init__(self, name: str, arguments: object, environment: object, say: Says, held: object) -> None:
        super().__init__(name, arguments, environment, say, held)
        if name == "recorder" and self.fails_at_once:
            self.failed, self.status = True, 1

    def stop(self, timeout_s: float) -> None:
        super().stop(timeout_s)
        if self.name == "recorder":
            self.failed, self.status = True, 1

    def ending(self) -> str:
        return "ended with status 1"


@pytest.mark.process
@pytest.mark.parametrize(
    ("at_once", "reason"), [(False, "the run was stopped before the first"), (True, "the recorder ended with status 1")]
)
def test_a_run_stopped_before_its_first_frame_blames_no_recorder_unless_that_had_failed_by_then(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: bool, reason: str
) -> None:
    monkeypatch.setattr("odom.service.run_processes.ChildProcess", RecorderOfNothing)
    monkeypatch.setattr(RecorderOfNothing, "fails_at_once", at_once)
    stop = threading.Event()
    threading.Timer(0.5, stop.set).start()
    with pytest.raises(OdomError, match=reason):
        run(RunPlan("arena", tmp_path, record=tmp_path / "a.mcap"), Settings(), stop, print)


class UntrackedChild(PretendedChild):
    """An odometry that has tracked none of five frames and ended."""

    def __init__(self, name: str, arguments: object, environment: object, say: Says, held: object) -> None:
        super().__init__(name, arguments, environment, say, held)
        if name == "odometry":
            say(name, '@report {"frames": 5, "tracked": 0, "lost_for": {"no texture": 5}}')
            self.status = 0


@pytest.mark.process
def test_a_failed_run_whose_viewer_stayed_says_why_and_not_that_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("odom.service.run_processes.ChildProcess", UntrackedChild)
    stop = threading.Event()
    plan = RunPlan("arena", tmp_path, viewer_arguments=["--web"], stay=True)
    with pytest.raises(OdomError, match="none of the 5 frames was tracked: 5 frames: no texture"):
        run(plan, Settings(), stop, lambda report: stop.set())  # which closes the viewer


@pytest.mark.process
@pytest.mark.parametrize(("arguments", "is_failure"), [(["--web"], False), (["--rrd=session.rrd"], True)])
def test_a_killed_viewer_fails_a_run_only_when_it_was_to_write_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], is_failure: bool
) -> None:
    monkeypatch.setattr("odom.service.run_processes.ChildProcess", KilledViewer)
    told: list[dict[str, Any]] = []
    with pytest.raises(OdomError, match="viewer was killed") if is_failure else nullcontext():
        run(RunPlan("arena", tmp_path, viewer_arguments=arguments), Settings(), threading.Event(), told.append)
    assert "the viewer was killed by SIGKILL; the run went on without it" in list(summary(told[0], tmp_path))


@pytest.mark.process
def test_the_report_is_told_when_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("odom.service.run_processes.ChildProcess", DoneChild)

    def full(path: Path, content: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("odom.service.local_run.write_json", full)
    told: list[dict[str, Any]] = []
    with pytest.raises(OdomError, match="make room"):
        run(RunPlan("arena", tmp_path), Settings(), threading.Event(), told.append)
    assert next(iter(summary(told[0], tmp_path))).startswith("4 of 5 frames tracked")


@pytest.mark.process
@pytest.mark.parametrize("has_failed", [False, True])
def test_a_folder_that_vanished_is_told_and_none_of_its_files_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_failed: bool
) -> None:
    out, told = tmp_path / "out", []

    class Vanishing(DoneChild):
        def __init__(self, name: str, arguments: object, environment: object, say: Says, held: object) -> None:
            super().__init__(name, arguments, environment, say, held)
            if name == "odometry":
                parts = [{"frames": 3}, {"frames": 1}]
                say(name, "@report " + json.dumps({"frames": 5, "tracked": 4, "unwritten": 1, "segments": parts}))
                self.failed = has_failed
                rmtree(out)

    monkeypatch.setattr("odom.service.run_processes.ChildProcess", Vanishing)
    monkeypatch.setattr(Vanishing, "ending", lambda self: "ended with status 1", raising=False)
    with pytest.raises(OdomError, match=f"^{out} is gone, with all that was written there") as refused:
        run(RunPlan("arena", out), Settings(), threading.Event(), told.append)
    lines = [str(refused.value), *summary(told[0], out)]
    assert not any(words in line for line in lines for words in ("make room", "files:", "trajectory.txt", "is in"))


def test_a_recorder_that_died_early_is_stood_in_for_until_the_source_has_seen_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("odom.service.stand_in._SEEN_S", 0.0)
    session = MagicMock()
    token = session.zenoh.liveliness().declare_token.return_value
    stand_in = StandIn(session, "cam0/ack/recorder")
    for _ in range(3):
        stand_in.step(both_are_here=False)
    session.zenoh.liveliness().declare_token.assert_called_once_with("cam0/ack/recorder")
    token.undeclare.assert_not_called()
    for _ in range(3):
        stand_in.step(both_are_here=True)
    stand_in.leave()
    token.undeclare.assert_called_once()


class Statuses:
    """What the odometry says every 20 ms: how many frames it has processed, or (None) nothing."""

    def __init__(self, frames: Iterable[int | None]) -> None:
        self._frames: Iterator[int | None] = iter(frames)

    def receive(self, timeout: float) -> Delivery | None:
        time.sleep(0.02)
        frames = next(self._frames)
        if frames is None:
            return None
        values = {"frames": str(frames), "state": "WAITING"}
        return Delivery(encode_status(Topics().status, Status(Stamp(1), "odometry", 0, "", values)))


def processes_at_work(
    frames: Iterable[int | None], stop: threading.Event
) -> tuple[RunProcesses, MagicMock, threading.Thread]:
    display = MagicMock()
    session: Any = SimpleNamespace(subscriber=lambda keys, depth: Statuses(frames))
    processes = RunProcesses(RunPlan("kinect", Path()), Settings(), "tcp/127.0.0.1:9", session, display)
    thread = threading.Thread(target=processes.work, args=(stop,), daemon=True)
    thread.start()
    return processes, display, thread


def test_a_sensor_whose_end_was_lost_ends_the_run_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("odom.service.run_processes.ChildProcess", PretendedChild)
    monkeypatch.setattr("odom.wire.idle_detector._IDLE_AFTER_S", 0.1)
    stop = threading.Event()
    processes, display, thread = processes_at_work(repeat(7), stop)
    thread.join(0.4)
    assert thread.is_alive()  # the sensor is only silent
    processes.children["sensor"].stop(0.0)
    thread.join(3.0)
    stop.set()
    assert not thread.is_alive()
    assert processes.children["odometry"].status == 0
    assert "the odometry has not heard" in display.say.call_args[0][1]


def test_names_that_begin_with_a_dash_are_no_options_of_the_children(monkeypatch: pytest.MonkeyPatch) -> None:
    started: dict[str, list[str]] = {}

    class NotedChild(PretendedChild):
        def __init__(self, name: str, arguments: list[str], environment: object, say: Says, held: object) -> None:
            super().__init__(name, arguments, environment, say, held)
            started[name] = arguments

    monkeypatch.setattr("odom.service.run_processes.ChildProcess", NotedChild)
    session: Any = SimpleNamespace(subscriber=lambda keys, depth: Statuses(repeat(None)))
    plan = RunPlan("-walk", Path(), record=Path("-o.mcap"), overwrite=True, sensor_arguments=["--start=1"])
    RunProcesses(plan, Settings(), "tcp/127.0.0.1:9", session, MagicMock())
    assert started["sensor"] == ["sensor", "--consumers", "2", "--start=1", "--", "-walk"]
    assert started["recorder"] == ["record", "--overwrite", "--", "-o.mcap"]


@pytest.mark.parametrize("frames", [count(), repeat(None)], ids=["processes", "saves"])
def test_an_odometry_at_work_is_waited_for_behind_its_sensor(
    monkeypatch: pytest.MonkeyPatch, frames: Iterable[int | None]
) -> None:
    monkeypatch.setattr("odom.service.run_processes.ChildProcess", PretendedChild)
    monkeypatch.setattr("odom.wire.idle_detector._IDLE_AFTER_S", 0.1)
    stop = threading.Event()
    processes, _, thread = processes_at_work(frames, stop)
    processes.children["sensor"].stop(0.0)
    thread.join(0.5)
    assert thread.is_alive()
    assert processes.children["odometry"].status is None
    stop.set()
    thread.join(3.0)
