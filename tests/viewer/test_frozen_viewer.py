"""A viewer that is stopped while it starts keeps nobody apart; a live run keeps its latency beside a stopped one."""

import json
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from threading import Event, Thread

import numpy as np
import psutil
import pytest
from rerun.chunk import RrdReader
from viewer_processes import Running

from odom.frame import Stamp
from odom.wire import Topics, WireSettings
from odom.wire.codec import encode_color
from odom.wire.session import Subscriber, WireSession, open_session
from odom.wire.settings import ANY_LOCAL_PORT

Start = Callable[..., Running]

_PERIOD_S = 0.02
_PHASE_S = 30.0
_FRAME = encode_color("cam0/color/image_raw", Stamp(0), np.zeros((480, 640, 3), np.uint8))


def _wait_for_a_connection(process: Running, timeout_s: float = 30.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not any(connection.raddr for connection in psutil.Process(process.pid).net_connections("inet")):
        assert time.monotonic() < deadline
        time.sleep(0.002)


class Traffic:
    """A sensor and an odometry as far as the wire goes, and when the latter got its frames."""

    def __init__(self, sensor: WireSession, odometry: WireSession) -> None:
        self.arrivals: list[float] = []
        self._stop = Event()
        self._subscriber = odometry.subscriber([_FRAME.topic])
        self._publisher = sensor.publisher()
        sensor.announce("cam0/alive")
        odometry.announce("cam0/alive/odometry")
        self._threads = [Thread(target=self._send), Thread(target=self._receive)]
        for thread in self._threads:
            thread.start()

    def longest_silence(self, seconds: float) -> float:
        """Return the longest time without a frame from the last one before now to the end of the next seconds."""
        first = max(0, len(self.arrivals) - 1)
        begin = time.monotonic()
        time.sleep(seconds)
        times = [*(self.arrivals[first:] or [begin]), time.monotonic()]
        return float(np.diff(times).max())

    def end(self) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def _send(self) -> None:
        while not self._stop.wait(_PERIOD_S):
            self._publisher.put(_FRAME)

    def _receive(self) -> None:
        while not self._stop.is_set():
            if self._subscriber.receive(0.1) is not None:
                self.arrivals.append(time.monotonic())


@pytest.mark.wallclock
def test_those_who_meet_while_a_viewer_is_stopped_need_it_not(start: Start, endpoint: str) -> None:
    """By default whoever comes first listens where the others meet: it must not be the viewer."""
    meeting = json.dumps([endpoint, ANY_LOCAL_PORT])
    view = start("view", "--web", "--web-port", "0", "--data-port", "0", listen=meeting)
    view.wait_for("viewer: http", 30)
    view.process.send_signal(signal.SIGSTOP)
    others = WireSettings(connect=(endpoint,), listen=(endpoint, ANY_LOCAL_PORT))
    with ExitStack() as stack:
        sensor, odometry = (stack.enter_context(open_session(others)) for _ in range(2))
        traffic = Traffic(sensor, odometry)
        stack.callback(traffic.end)
        traffic.longest_silence(2.0)
        assert len(traffic.arrivals) > 50
        seen = Event()
        odometry.watch("cam0/alive/viewer", lambda key, alive: seen.set() if alive else None)
        view.process.send_signal(signal.SIGCONT)
        assert seen.wait(10)


@pytest.mark.wallclock
@pytest.mark.parametrize("delay_s", [0.0, 0.03, 0.3])
def test_a_viewer_stopped_while_it_connects_silences_nobody_beyond_its_lease(
    start: Start, endpoint: str, delay_s: float
) -> None:
    """Mostly .14 s; a link that freezes in its handshake on a busy machine may hold senders up until its lease ends."""
    with ExitStack() as stack:
        stack.enter_context(open_session(WireSettings(connect=(), listen=(endpoint,))))
        others = WireSettings(connect=(endpoint,), listen=(ANY_LOCAL_PORT,))
        sensor, odometry = (stack.enter_context(open_session(others)) for _ in range(2))
        traffic = Traffic(sensor, odometry)
        stack.callback(traffic.end)
        view = start("view", "--web", "--web-port", "0", "--data-port", "0")
        _wait_for_a_connection(view)
        time.sleep(delay_s)
        view.process.send_signal(signal.SIGSTOP)
        silence = traffic.longest_silence(4.0)
        print(f"stopped {delay_s} s after its first connection: no frame for {1e3 * silence:.0f} ms")
        assert silence < others.lease_ms / 1000 + 0.5


def _latencies_ms(poses: Subscriber, seconds: float) -> list[float]:
    """How long after its capture each pose of the next `seconds` was published."""
    values: list[float] = []
    deadline = time.monotonic() + seconds
    while (left := deadline - time.monotonic()) > 0:
        if (delivery := poses.receive(left)) is not None and delivery.sent is not None:
            values.append((delivery.sent - delivery.message.stamp) * 1e-6)
    return values


def _told_to_type(words: Path, timeout_s: float = 30.0) -> list[str]:
    """The arguments of the `odom` command that a run prints for those who want to watch it."""
    deadline = time.monotonic() + timeout_s
    while (found := re.search(r"to watch it: odom (.+)", words.read_text())) is None:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    return shlex.split(found[1])


def _walked_m(odometry: Path) -> float:
    """The length of the way in a TUM file; every tenth pose, since noise makes a way longer."""
    return float(np.linalg.norm(np.diff(np.loadtxt(odometry)[::10, 1:4], axis=0), axis=1).sum())


def _shown_m(rrd: Path) -> float:
    """The length of the corrected way in the newest picture."""
    chunks = [chunk for chunk in RrdReader(rrd).stream() if chunk.entity_path == "/world/corrected"]
    strips = chunks[-1].to_record_batch().column("LineStrips3D:strips")[-1].as_py()
    return float(sum(np.linalg.norm(np.diff(np.array(strip), axis=0), axis=1).sum() for strip in strips))


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_live_run_keeps_its_latency_beside_a_frozen_viewer_and_a_new_one_shows_the_whole_way(tmp_path: Path) -> None:
    """Phases of 30 s: the run's own web viewer shows it, is frozen, and after its death a new one shows it."""
    out, words = tmp_path / "out", tmp_path / "words.txt"
    command = [sys.executable, "-m", "odom", "run", "arena", "--live", "--web", "--seconds", str(3 * _PHASE_S + 40)]
    with ExitStack() as stack:
        output = stack.enter_context(words.open("wb"))
        run = subprocess.Popen([*command, "--out", str(out)], stdout=output, stderr=subprocess.STDOUT)
        stack.callback(run.wait, 60)
        stack.callback(run.terminate)
        stack.callback(lambda: print(words.read_text()[-2000:]))
        watch = _told_to_type(words)
        endpoint = watch[watch.index("--connect") + 1]
        session = stack.enter_context(open_session(WireSettings(connect=(endpoint,), listen=())))
        poses = session.subscriber([Topics("cam0").odom], depth=64)
        assert poses.receive(120) is not None, words.read_text()
        viewer = next(child for child in psutil.Process(run.pid).children() if "view" in child.cmdline())
        _latencies_ms(poses, 5.0)
        shown = _latencies_ms(poses, _PHASE_S)
        viewer.send_signal(signal.SIGSTOP)
        frozen = _latencies_ms(poses, _PHASE_S)
        viewer.kill()
        second = Running(["-m", "odom", *watch, "--headless", "--rrd", str(tmp_path / "second.rrd")], {})
        stack.callback(second.kill)
        second.wait_for("showing cam0", 60)
        restarted = _latencies_ms(poses, _PHASE_S)
        assert second.stop() == 0
        walked = _walked_m(out / "odometry.txt")
    p99 = [float(np.quantile(values, 0.99)) for values in (shown, frozen, restarted)]
    print("p99 of the latency beside a viewer, a frozen one, a new one: {:.1f}, {:.1f}, {:.1f} ms".format(*p99))
    assert len(frozen) > 0.98 * len(shown)
    assert p99[1] < 1.1 * p99[0]
    print(f"walked {walked:.2f} m, the new viewer shows {_shown_m(tmp_path / 'second.rrd'):.2f} m of it")
    assert _shown_m(tmp_path / "second.rrd") == pytest.approx(walked, rel=0.1)
