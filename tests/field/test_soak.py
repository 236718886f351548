"""A run of some minutes at 30 Hz: memory flat, nothing lost, latency as at the start.

Run by hand: ODOM_SOAK_MINUTES sets the length, two where it is not given, thirty for a quiet machine.
"""

import os
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
import psutil
import pytest
from playing import TOPICS, PlayingKinect
from rig import Process, free_port, processes, service_priority

from odom.wire import WireSettings
from odom.wire.codec import decode_status
from odom.wire.session import open_session

MINUTES = float(os.environ.get("ODOM_SOAK_MINUTES", "2"))
SETTLED_S = min(120.0, 60 * MINUTES / 3)
STARTING_S = 5.0


@pytest.mark.slow
@pytest.mark.timeout(int(60 * MINUTES) + 600)
def test_memory_flat_nothing_lost_latency_as_at_the_start(rig: PlayingKinect, tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    meet = ["--mode", "client", "--connect", endpoint]
    commands = {
        "odometry": ["serve", "--out", tmp_path / "out", *meet],
        "recorder": ["record", tmp_path / "take.mcap", *meet],
        "sensor": ["sensor", "kinect", "--option", f"size={rig.size}", *meet],
    }
    memory: dict[str, list[tuple[float, float]]] = defaultdict(list)
    latency: list[tuple[float, float]] = []
    frames = 0
    with processes() as started:
        router = Process("router", tmp_path / "router.log", ["router", "--listen", endpoint])
        started.append(router)
        router.wait_for("routing at", 60)
        for name, command in commands.items():
            prefix = service_priority() if name == "odometry" else ()
            started.append(Process(name, tmp_path / f"{name}.log", command, prefix))
            if name == "odometry":
                started[-1].wait_for("ready after", 300)
        with open_session(WireSettings(mode="client", connect=(endpoint,))) as session:
            subscriber = session.subscriber([TOPICS.odom, TOPICS.status])
            begun = time.monotonic()
            next_sample = 0.0
            last_status = None
            while (now := time.monotonic() - begun) < 60 * MINUTES:
                delivery = subscriber.receive(0.5)
                if delivery is not None and delivery.message.topic == TOPICS.odom:
                    latency.append((now, 1e-6 * (time.time_ns() - delivery.message.stamp)))
                    frames += 1
                elif delivery is not None:
                    last_status = decode_status(delivery.message)[0]
                if now >= next_sample:
                    next_sample = now + 2.0
                    for process in started:
                        assert process.popen.poll() is None, process.said[-2000:]
                        memory[process.name].append((now, psutil.Process(process.popen.pid).memory_info().rss * 1e-6))
        for process in reversed(started):
            process.end(60)
    times = np.array(latency)
    third = (times[-1, 0] - SETTLED_S) / 3
    first = times[(times[:, 0] > SETTLED_S) & (times[:, 0] < SETTLED_S + third), 1]
    last = times[times[:, 0] > times[-1, 0] - third, 1]
    growth = {}
    for name, samples in memory.items():
        sizes = np.array([size for at, size in samples if at > SETTLED_S])
        half = len(sizes) // 2
        growth[name] = float(np.median(sizes[half:]) - np.median(sizes[:half]))
    lost = int(last_status.values.get("lost_frames", "0")) if last_status is not None else -1
    print(
        {
            "minutes": MINUTES,
            "poses": frames,
            "lost frames": lost,
            "growth MB": {name: round(mb, 1) for name, mb in growth.items()},
            "latency p99 first, last ms": (
                round(float(np.percentile(first, 99))),
                round(float(np.percentile(last, 99))),
            ),
            "load": os.getloadavg(),
        }
    )
    assert all(mb < 5 for mb in growth.values()), growth
    assert lost == 0
    assert frames >= 30 * (60 * MINUTES - STARTING_S)
    assert np.percentile(last, 99) < 1.5 * np.percentile(first, 99) + 10
