"""Malformed messages on every key at full speed beside a run."""

import random
import threading
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from rig import Process, free_port, processes

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
from odom.wire.session import open_session

RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"
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


def run(folder: Path, per_key: int) -> tuple[bytes, float, int]:
    """Track the recording under fire; return the trajectory, its peak of memory in MB, the messages thrown."""
    folder.mkdir()
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    meet = ["--mode", "client", "--connect", endpoint]
    thrown = 0
    with processes() as started:
        started.append(Process("router", folder / "router.log", ["router", "--listen", endpoint]))
        started[0].wait_for("routing at", 60)
        odometry = Process(
            "odometry", folder / "odometry.log", ["serve", "--out", folder / "out", "--until-end", *meet]
        )
        started.append(odometry)
        odometry.wait_for("ready after", 300)
        with open_session(WireSettings(mode="client", connect=(endpoint,))) as session:
            payloads = malformed(64)

            def throw() -> None:
                nonlocal thrown
                for index in range(per_key):
                    for key in KEYS:
                        session.zenoh.put(key, payloads[(index * 7 + thrown) % len(payloads)])
                        thrown += 1

            thrower = threading.Thread(target=throw)
            thrower.start()
            sensor = Process("sensor", folder / "sensor.log", ["sensor", RECORDING, *meet])
            started.append(sensor)
            memory = []
            deadline = time.monotonic() + 600
            while odometry.popen.poll() is None:
                assert time.monotonic() < deadline, odometry.said[-2000:]
                try:
                    memory.append(psutil.Process(odometry.popen.pid).memory_info().rss * 1e-6)
                except psutil.NoSuchProcess:
                    break
                time.sleep(0.1)
            thrower.join()
        assert odometry.popen.wait() == 0, odometry.said[-3000:]
    return (folder / "out" / "odometry.txt").read_bytes(), max(memory), thrown


def compare(folder: Path, per_key: int) -> None:
    quiet, quiet_mb, _ = run(folder / "quiet", 0)
    flooded, flooded_mb, thrown = run(folder / "flooded", per_key)
    print({"malformed messages": thrown, "peak MB without": round(quiet_mb), "with": round(flooded_mb)})
    assert thrown == per_key * len(KEYS)
    assert flooded == quiet
    # What waits is bounded in bytes; millions of messages may not be seen in the memory beyond that bound.
    assert flooded_mb < quiet_mb + 64


@pytest.mark.timeout(900)
def test_a_flood_of_malformed_messages_changes_nothing(tmp_path: Path) -> None:
    compare(tmp_path, 6_000)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_hundred_thousand_malformed_messages_on_every_key_change_nothing(tmp_path: Path) -> None:
    compare(tmp_path, 100_000)
