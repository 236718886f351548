"""The order in which the processes of one run come and go, with children that only pretend."""

import json
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from itertools import count, repeat
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest

from odom.errors import OdomError
from odom.frame import Stamp
from odom.service.local_run import RunPlan, RunProcesses, run
from odom.service.settings import Settings
from odom.wire import Topics
from odom.wire.codec import Status, encode_status
from odom.wire.session import Delivery

Says = Callable[[str, str], None]


class PretendedChild:
    """Ends with status 0 when it is asked to."""

    peak_rss_mb, cpu_s = 1.0, 0.1

    def __init__(self, name: str, arguments: object, environment: object, say: Says) -> None:
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
    monkeypatch.setattr("odom.service.local_run.ChildProcess", PretendedChild)
    (tmp_path / "report.json").write_text(json.dumps({"frames": 5}))
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "session.rrd").write_bytes(b"shown then")
    stop = threading.Event()
    stop.set()
    with pytest.raises(OdomError, match="stopped before the first"):
        run(RunPlan("arena", tmp_path), Settings(), stop)
    assert "frames" not in json.loads((tmp_path / "report.json").read_text())
    assert (tmp_path / "notes.txt").exists()
    assert not (tmp_path / "session.rrd").exists()


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
    monkeypatch.setattr("odom.service.local_run.ChildProcess", PretendedChild)
    monkeypatch.setattr("odom.wire.idle_detector._IDLE_AFTER_S", 0.3)
    stop = threading.Event()
    processes, display, thread = processes_at_work(repeat(7), stop)
    thread.join(1.0)
    assert thread.is_alive()  # the sensor is only silent
    processes.children["sensor"].stop(0.0)
    thread.join(3.0)
    stop.set()
    assert not thread.is_alive()
    assert processes.children["odometry"].status == 0
    assert "the odometry has not heard" in display.say.call_args[0][1]


@pytest.mark.parametrize("frames", [count(), repeat(None)], ids=["processes", "saves"])
def test_an_odometry_at_work_is_waited_for_behind_its_sensor(
    monkeypatch: pytest.MonkeyPatch, frames: Iterable[int | None]
) -> None:
    monkeypatch.setattr("odom.service.local_run.ChildProcess", PretendedChild)
    monkeypatch.setattr("odom.wire.idle_detector._IDLE_AFTER_S", 0.3)
    stop = threading.Event()
    processes, _, thread = processes_at_work(frames, stop)
    processes.children["sensor"].stop(0.0)
    thread.join(1.5)
    assert thread.is_alive()
    assert processes.children["odometry"].status is None
    stop.set()
    thread.join(3.0)
