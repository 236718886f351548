"""Malformed messages on every key at full speed beside a run, of which every message or only the newest counts."""

import json
import os
import random
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
import pytest
from rig import Process, free_port, processes, service_priority

from odom.frame import Camera, Stamp
from odom.wire import TF, Topics, WireSettings, truth
from odom.wire.codec import (
    encode_camera_info,
    encode_color,
    encode_color_jpeg,
    encode_depth,
    encode_depth_compressed,
    encode_pose,
)
from odom.wire.session import WireSession, open_session

RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"
RECORDED_SLOWER = 4.0
"""The recording holds every fourth frame of a camera at 30 Hz."""
TOPICS = Topics("cam0")
KEYS = (
    TOPICS.color,
    TOPICS.color_compressed,
    TOPICS.depth,
    TOPICS.depth_compressed,
    TOPICS.camera_info,
    TOPICS.odom,
    TOPICS.pose,
    TOPICS.path,
    TOPICS.status,
    TOPICS.loops,
    TOPICS.features,
    TOPICS.landmarks,
    TOPICS.keyframes,
    TOPICS.ack_of("odometry"),
    TOPICS.ack_of("nobody"),
    TOPICS.end,
    TF,
    truth("rig"),
)


def malformed(count: int) -> list[bytes]:
    """Random bytes, and real messages cut short."""
    rng = random.Random(5)
    image = np.zeros((240, 320, 3), dtype=np.uint8)
    depth = np.zeros((240, 320), dtype=np.uint16)
    real = [
        encode_color("k", Stamp(1), image).payload,
        encode_color_jpeg("k", Stamp(1), image).payload,
        encode_depth("k", Stamp(1), depth).payload,
        encode_depth_compressed("k", Stamp(1), depth).payload,
        encode_camera_info("k", Stamp(1), Camera(320, 240, 262.5, 262.5, 160, 120)).payload,
        encode_pose("k", Stamp(1), np.eye(4), "map").payload,
    ]
    payloads = []
    for index in range(count):
        whole = real[index % len(real)]
        cut = whole[: rng.randrange(min(len(whole), 2000))]
        payloads.append(cut if index % 2 else rng.randbytes(rng.randrange(300)))
    return payloads


@dataclass
class Run:
    """What a run left: the trajectory as published, frames lost, the odometry's memory in MB over time."""

    poses: list[str]
    lost: int
    memory: list[float]
    thrown: int


def throw(session: WireSession, per_key: int) -> int:
    """Send `per_key` malformed messages on every key as fast as the session takes them; return how many."""
    payloads = malformed(64)
    thrown = 0
    for index in range(per_key):
        for key in KEYS:
            session.zenoh.put(key, payloads[(index * 7 + thrown) % len(payloads)])
            thrown += 1
    return thrown


def run(folder: Path, per_key: int, frames: int, live: bool) -> Run:
    """Track the recording, played round and round, for `frames` and until all is thrown.

    `live`: at 30 Hz sharp, with the priority of the service.
    """
    priority = service_priority()
    if live and not priority:
        pytest.skip("needs the right to run at the service's priority")
    folder.mkdir()
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    meet = ["--mode", "client", "--connect", endpoint]
    poses = folder / "out" / "odometry.txt"
    with processes() as started, ThreadPoolExecutor(1) as aside:
        started.append(Process("router", folder / "router.log", ["router", "--listen", endpoint]))
        started[0].wait_for("routing at", 60)
        serve = ["serve", "--out", folder / "out", "--until-end", *meet]
        odometry = Process("odometry", folder / "odometry.log", serve, prefix=priority if live else ())
        started.append(odometry)
        odometry.wait_for("ready after", 300)
        pace = ["--realtime", "--rate", RECORDED_SLOWER, "--consumers", 1] if live else []
        sensor = Process("sensor", folder / "sensor.log", ["sensor", RECORDING, "--loop", *pace, *meet])
        started.append(sensor)
        memory = []
        with open_session(WireSettings(mode="client", connect=(endpoint,))) as session:
            wait_for_lines(poses, 30, odometry)
            flood = aside.submit(throw, session, per_key)
            deadline = time.monotonic() + 800
            while not flood.done() or lines(poses) < frames:
                assert odometry.popen.poll() is None, odometry.said[-2000:]
                assert time.monotonic() < deadline, odometry.said[-2000:]
                memory.append(psutil.Process(odometry.popen.pid).memory_info().rss * 1e-6)
                time.sleep(0.1)
            thrown = flood.result()
        sensor.end(60)
        assert odometry.popen.wait(60) == 0, odometry.said[-3000:]
    report = json.loads((folder / "out" / "report.json").read_text())
    return Run(poses.read_text().splitlines(), report["lost_frames"], memory, thrown)


def lines(file: Path) -> int:
    return file.read_bytes().count(b"\n") if file.exists() else 0


def wait_for_lines(file: Path, count: int, process: Process) -> None:
    end = time.monotonic() + 60
    while lines(file) < count:
        assert time.monotonic() < end, process.said[-2000:]
        time.sleep(0.05)


def compare(folder: Path, per_key: int, frames: int, live: bool = False) -> None:
    quiet = run(folder / "quiet", 0, 2 * frames, live)  # comes first: it compiles, if anything does
    flooded = run(folder / "flooded", per_key, frames, live)
    print(
        {
            "malformed messages": flooded.thrown,
            "poses beside them": len(flooded.poses),
            "frames lost without, with": (quiet.lost, flooded.lost),
            "peak MB without, with": (round(max(quiet.memory)), round(max(flooded.memory))),
            "load": os.getloadavg()[0],
        }
    )
    assert flooded.thrown == per_key * len(KEYS)
    common = min(len(quiet.poses), len(flooded.poses))
    assert common >= frames
    assert flooded.poses[:common] == quiet.poses[:common]
    # What waits is bounded in bytes; millions of messages may not be seen in the memory beyond that bound.
    assert max(flooded.memory) < max(quiet.memory) + 64


@pytest.mark.alone
@pytest.mark.timeout(900)
def test_a_flood_of_malformed_messages_changes_nothing(tmp_path: Path) -> None:
    compare(tmp_path, 6_000, 240)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_hundred_thousand_malformed_messages_on_every_key_change_nothing(tmp_path: Path) -> None:
    compare(tmp_path, 100_000, 900)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_beside_a_hundred_thousand_malformed_messages_on_every_key_a_live_run_loses_nothing(tmp_path: Path) -> None:
    compare(tmp_path, 100_000, 900, live=True)
