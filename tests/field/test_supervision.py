"""Processes killed without warning under a supervisor that starts them again, as systemd or Docker do."""

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playing import PlayingKinect
from rig import Process, free_port, processes

from odom.wire import Topics, WireSettings
from odom.wire.recording import RecordingReader
from odom.wire.session import WireSession, open_session

TOPICS = Topics("cam0")


class Watch:
    """A client of the router that knows when it last heard of each process."""

    def __init__(self, session: WireSession, recordings: Path) -> None:
        self.heard: dict[str, float] = {}
        self._recordings = recordings
        self._size = 0
        self._stop = threading.Event()
        self._subscriber = session.subscriber([TOPICS.depth, TOPICS.depth_compressed, TOPICS.odom])
        self._alive: set[str] = set()
        session.watch(
            f"{TOPICS.alive}/**", lambda key, living: (self._alive.add if living else self._alive.discard)(key)
        )
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        while not self._stop.is_set():
            delivery = self._subscriber.receive(0.1)
            now = time.monotonic()
            if delivery is not None:
                self.heard["odometry" if delivery.message.topic == TOPICS.odom else "sensor"] = now
            if TOPICS.alive_of("viewer") in self._alive:
                self.heard["viewer"] = now
            size = sum(file.stat().st_size for file in self._recordings.glob("*.mcap"))
            if size > self._size:
                self.heard["recorder"] = now
            self._size = size

    def whole_since(self, moment: float) -> bool:
        return all(self.heard.get(role, 0.0) > moment for role in ("sensor", "odometry", "recorder", "viewer"))

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


@contextmanager
def supervised(kinect: PlayingKinect, folder: Path) -> Iterator[tuple[dict[str, Process], Watch]]:
    """Router, sensor, odometry, recorder and viewer; whichever dies is started again at once."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    meet = ["--mode", "client", "--connect", endpoint]
    recordings = folder / "recordings"
    recordings.mkdir()
    commands = {
        "router": ["router", "--listen", endpoint],
        "odometry": ["serve", "--out", folder / "out", *meet],
        "recorder": ["record", recordings / "take-{time}.mcap", *meet],
        "viewer": ["view", "--web", *meet],
        "sensor": ["sensor", "kinect", "--option", f"size={kinect.size}", *meet],
    }
    stop = threading.Event()
    with processes() as started:
        rig = {}
        for name, command in commands.items():
            rig[name] = Process(name, folder / f"{name}.log", command)
            started.append(rig[name])
            if name == "router":
                rig[name].wait_for("routing at", 60)

        def supervise() -> None:
            while not stop.wait(0.05):
                for process in rig.values():
                    if process.popen.poll() is not None:
                        process.start()

        supervisor = threading.Thread(target=supervise, daemon=True)
        supervisor.start()
        with open_session(WireSettings(mode="client", connect=(endpoint,))) as session:
            watch = Watch(session, recordings)
            try:
                yield rig, watch
            finally:
                stop.set()
                supervisor.join()
                watch.close()
        for process in reversed(rig.values()):
            process.end(60)


def kill_each(
    rig: dict[str, Process], watch: Watch, every_s: float, until: Callable[[], bool], patience_s: float
) -> list[tuple[str, float]]:
    """Kill one after the other; return how long it took each time until all were at work again."""
    took = []
    for name in itertools.cycle(["sensor", "odometry", "recorder", "viewer", "router"]):
        if until():
            return took
        begun = time.monotonic()
        rig[name].popen.kill()
        while not watch.whole_since(begun + 0.1):
            assert time.monotonic() - begun < patience_s, f"not whole after {name}: {rig[name].said[-1500:]}"
            time.sleep(0.02)
        took.append((name, time.monotonic() - begun))
        while time.monotonic() - begun < every_s:
            time.sleep(0.05)
    return took


def wait_until_whole(watch: Watch, seconds: float) -> None:
    begun = time.monotonic()
    while not watch.whole_since(begun):
        assert time.monotonic() - begun < seconds, watch.heard
        time.sleep(0.1)


def check_what_was_left(folder: Path) -> None:
    """Every recording opens, cut or not; every line of every trajectory is whole and later than the one before."""
    recordings = sorted((folder / "recordings").glob("*.mcap"))
    assert sum(1 for file in recordings for _ in RecordingReader(file).messages()) > 100
    files = sorted((folder / "out").rglob("odometry.txt"))
    assert len(files) >= 2
    for file in files:
        lines = [line.split() for line in file.read_text().splitlines() if not line.startswith("#")]
        assert all(len(line) == 8 for line in lines)
        stamps = [float(line[0]) for line in lines]
        assert stamps == sorted(set(stamps))


@pytest.mark.timeout(900)
def test_each_process_killed_once_the_pipeline_is_whole_again(rig: PlayingKinect, tmp_path: Path) -> None:
    with supervised(rig, tmp_path) as (started, watch):
        wait_until_whole(watch, 240)
        remaining = iter(range(6))
        took = kill_each(started, watch, 1.0, lambda: next(remaining) == 5, 120)
    print({name: round(seconds, 2) for name, seconds in took})
    assert len(took) == 5
    check_what_was_left(tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_killed_every_ten_seconds_for_five_minutes_it_is_whole_within_three(rig: PlayingKinect, tmp_path: Path) -> None:
    with supervised(rig, tmp_path) as (started, watch):
        wait_until_whole(watch, 240)
        end = time.monotonic() + 300
        took = kill_each(started, watch, 10.0, lambda: time.monotonic() > end, 60)
    print({name: [round(s, 2) for n, s in took if n == name] for name in started})
    check_what_was_left(tmp_path)
    assert max(seconds for _, seconds in took) < 3.0
