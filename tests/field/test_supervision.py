"""Processes killed without warning under a supervisor that starts them again, as systemd or Docker do."""

import itertools
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest
from playing import PlayingKinect
from rig import Process, free_port, processes

from odom.wire import Topics, WireSettings
from odom.wire.recording import RecordingReader
from odom.wire.session import WireSession, open_session

TOPICS = Topics("cam0")
HOLE_S = 0.5
PLACE_S = 1.5
"""The odometry tries for a second to recognise the place before it begins a new segment."""


class Watch:
    """A client of the router that knows when it last heard of each process."""

    def __init__(self, session: WireSession, recordings: Path) -> None:
        self.heard: dict[str, float] = {}
        self._viewer_since: float | None = None
        self._recordings = recordings
        self._size = 0
        self._stop = threading.Event()
        self._subscriber = session.subscriber([TOPICS.depth, TOPICS.depth_compressed, TOPICS.odom])
        session.watch(TOPICS.alive_of("viewer"), self._viewer_changed)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        while not self._stop.is_set():
            delivery = self._subscriber.receive(0.1)
            now = time.monotonic()
            if delivery is not None:
                self.heard["odometry" if delivery.message.topic == TOPICS.odom else "sensor"] = now
            size = sum(file.stat().st_size for file in self._recordings.glob("*.mcap*"))
            if size > self._size:
                self.heard["recorder"] = now
            self._size = size

    def _viewer_changed(self, key: str, living: bool) -> None:
        self._viewer_since = time.monotonic() if living else None

    def whole_since(self, moment: float, new_viewer: bool = False) -> bool:
        """Whether all were at work after `moment`; of a viewer that was killed the old announcement does not count."""
        at_work = all(self.heard.get(role, 0.0) > moment for role in ("sensor", "odometry", "recorder"))
        viewer = self._viewer_since
        return at_work and viewer is not None and (viewer > moment or not new_viewer)

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


@dataclass(frozen=True)
class Outage:
    """Who was killed, when by the clock of the stamps, and after how many seconds all were at work again."""

    name: str
    at: float
    seconds: float


def kill_each(
    rig: dict[str, Process], watch: Watch, every_s: float, until: Callable[[], bool], patience_s: float
) -> list[Outage]:
    """Kill one after the other, and wait each time until all are at work again."""
    took = []
    for name in itertools.cycle(["sensor", "odometry", "recorder", "viewer", "router"]):
        if until():
            return took
        begun, at = time.monotonic(), time.time()
        victim = rig[name].popen
        victim.kill()
        victim.wait()
        dead = time.monotonic()
        while not watch.whole_since(dead + 0.1, new_viewer=name == "viewer"):
            assert time.monotonic() - begun < patience_s, f"not whole after {name}: {rig[name].said[-1500:]}"
            time.sleep(0.02)
        took.append(Outage(name, at, time.monotonic() - begun))
        while time.monotonic() - begun < every_s:
            time.sleep(0.05)
    return took


def wait_until_whole(watch: Watch, seconds: float) -> None:
    begun = time.monotonic()
    while not watch.whole_since(begun):
        assert time.monotonic() - begun < seconds, watch.heard
        time.sleep(0.1)


def check_what_was_left(folder: Path, outages: list[Outage]) -> None:
    """Every recording opens, cut or not; every trajectory's lines are whole and in order; holes have their reason."""
    recordings = sorted((folder / "recordings").glob("*.mcap*"))
    kept = [m.stamp * 1e-9 for file in recordings for m in RecordingReader(file).messages() if m.topic == TOPICS.depth]
    assert len(kept) > 100
    check_holes(kept, outages)
    files = sorted((folder / "out").rglob("odometry.txt"))
    assert len(files) >= 2
    poses: list[float] = []
    for file in files:
        lines = [line.split() for line in file.read_text().splitlines() if not line.startswith("#")]
        assert all(len(line) == 8 for line in lines)
        stamps = [float(line[0]) for line in lines]
        assert stamps == sorted(set(stamps))
        poses += stamps
    check_holes(poses, outages)


def check_holes(stamps: list[float], outages: list[Outage]) -> None:
    """From the first death on, holes lie where something was dead or where the odometry finds its place again."""
    ordered = sorted(stamps)
    for before, after in pairwise(ordered):
        if after - before > HOLE_S and after > outages[0].at:
            assert any(o.at - HOLE_S < after and before < o.at + o.seconds + PLACE_S for o in outages), (before, after)


@pytest.mark.timeout(900)
def test_each_process_killed_once_the_pipeline_is_whole_again(rig: PlayingKinect, tmp_path: Path) -> None:
    with supervised(rig, tmp_path) as (started, watch):
        wait_until_whole(watch, 240)
        remaining = iter(range(6))
        took = kill_each(started, watch, 1.0, lambda: next(remaining) == 5, 120)
    print({outage.name: round(outage.seconds, 2) for outage in took})
    assert len(took) == 5
    check_what_was_left(tmp_path, took)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_killed_every_ten_seconds_for_five_minutes_it_is_whole_within_three(rig: PlayingKinect, tmp_path: Path) -> None:
    with supervised(rig, tmp_path) as (started, watch):
        wait_until_whole(watch, 240)
        end = time.monotonic() + 300
        took = kill_each(started, watch, 10.0, lambda: time.monotonic() > end, 60)
    print({name: [round(o.seconds, 2) for o in took if o.name == name] for name in started}, os.getloadavg())
    check_what_was_left(tmp_path, took)
    assert max(outage.seconds for outage in took) < 3.0
