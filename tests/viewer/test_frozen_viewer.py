"""A viewer that is stopped while it starts keeps nobody apart; a live run keeps its latency beside a stopped one."""

import json
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from threading import Event, Thread

import numpy as np
import psutil
import pytest
from viewer_processes import Running

from odom.frame import Stamp
from odom.wire import WireSettings
from odom.wire.codec import encode_text
from odom.wire.session import WireSession, open_session
from odom.wire.settings import ANY_LOCAL_PORT

Start = Callable[..., Running]

_PERIOD_S = 0.02
_FRAME = encode_text("cam0/color/image_raw", Stamp(0), "x" * 900_000)


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


@pytest.mark.parametrize("delay_s", [0.0, 0.03, 0.3])
def test_a_viewer_stopped_while_it_connects_silences_nobody(start: Start, endpoint: str, delay_s: float) -> None:
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
        assert silence < 0.5
