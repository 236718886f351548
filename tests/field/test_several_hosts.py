"""Sensor and odometry on different hosts: network namespaces with a link of known quality between them."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from network import ADDRESSES, Hosts, LinkQuality, compile_link, two_hosts
from playing import PlayingKinect
from rig import Process, processes

ENDPOINT = f"tcp/{ADDRESSES[1]}:7447"
MEET = ["--mode", "client", "--connect", ENDPOINT]


@pytest.fixture(scope="module")
def link_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_link(tmp_path_factory.mktemp("link"))


@dataclass
class Run:
    """The processes of a run over two hosts and what a monitor beside the odometry has written."""

    hosts: Hosts
    sensor: Process
    monitor: Path

    def arrivals(self, topic_part: str) -> np.ndarray:
        """n x 2: capture stamp and arrival in seconds."""
        lines = [line.split() for line in self.monitor.read_text().splitlines() if topic_part in line]
        return (
            np.array([[int(line[1]), int(line[2])] for line in lines if len(line) == 3], dtype=np.int64).reshape(-1, 2)
            * 1e-9
        )


@contextmanager
def across(
    program: Path, quality: LinkQuality, kinect: PlayingKinect, folder: Path, *sensor_options: str
) -> Iterator[Run]:
    """The Kinect on host 0; router, odometry and monitor on host 1."""
    with two_hosts(program, quality, folder) as hosts, processes() as started:

        def start(name: str, host: int, *arguments: object) -> Process:
            started.append(Process(name, folder / f"{name}.log", arguments, prefix=hosts.on(host)))
            return started[-1]

        start("router", 1, "router", "--listen", ENDPOINT).wait_for("routing at", 60)
        start("odometry", 1, "serve", "--out", folder / "out", *MEET).wait_for("ready after", 240)
        monitor = folder / "arrivals.txt"
        script = Path(__file__).parent / "monitor.py"
        keys = ["cam0/color/**", "cam0/depth/**", "cam0/odom"]
        watcher = subprocess.Popen([*hosts.on(1), sys.executable, script, ENDPOINT, monitor, *keys])
        try:
            sensor = start("sensor", 0, "sensor", "kinect", *MEET, "--option", f"size={kinect.size}", *sensor_options)
            deadline = time.monotonic() + 60
            while not monitor.exists() or "cam0/odom" not in monitor.read_text():
                assert time.monotonic() < deadline, [process.said for process in started]
                time.sleep(0.1)
            yield Run(hosts, sensor, monitor)
        finally:
            watcher.send_signal(signal.SIGKILL)
            watcher.wait()


def rate_and_latency(arrivals: np.ndarray, odom: np.ndarray) -> dict[str, float]:
    """Frames a second over the middle of the run; latency from capture to the odometry's pose, in ms."""
    seconds = arrivals[-1, 1] - arrivals[0, 1]
    latency = 1e3 * (odom[:, 1] - odom[:, 0])
    return {
        "frames per second": (len(arrivals) - 1) / seconds,
        "frames captured per second": (len(arrivals) - 1) / (arrivals[-1, 0] - arrivals[0, 0]),
        "pose latency p50 ms": float(np.median(latency)),
        "pose latency p99 ms": float(np.percentile(latency, 99)),
        "pose latency max ms": float(latency.max()),
        "load": os.getloadavg()[0],
    }


@pytest.mark.timeout(600)
def test_a_cut_link_heals_by_itself(link_program: Path, rig: PlayingKinect, tmp_path: Path) -> None:
    with across(link_program, LinkQuality(), rig, tmp_path, "--color", "jpeg", "--depth", "rvl") as run:
        time.sleep(2)
        run.hosts.cut()
        cut = time.time()
        time.sleep(5)
        run.hosts.mend()
        mended = time.time()
        deadline = time.monotonic() + 10
        while not (run.arrivals("cam0/odom")[:, 1] > mended).any() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(1)
        odom = run.arrivals("cam0/odom")
    resumed = odom[odom[:, 1] > mended]
    print({"resumed after s": resumed[0, 1] - mended, "odometry before": int((odom[:, 1] < cut).sum())})
    assert len(resumed) > 5
    assert resumed[0, 1] - mended < 2.0
    # What comes first after the cut is new, not what waited.
    assert resumed[1, 0] > mended - 1.0


LINKS = {
    "1 Gbit/s, raw": (LinkQuality(1.0, 1000.0, 0.0), ("--color", "raw", "--depth", "raw")),
    "100 Mbit/s, JPEG and RVL": (LinkQuality(1.0, 100.0, 0.0), ("--color", "jpeg", "--depth", "rvl")),
    "2 % loss, JPEG and RVL": (LinkQuality(1.0, 1000.0, 2.0, "bbr"), ("--color", "jpeg", "--depth", "rvl")),
}


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("link", LINKS)
def test_30_hz_vga_across_two_hosts(link_program: Path, vga_rig: PlayingKinect, tmp_path: Path, link: str) -> None:
    quality, options = LINKS[link]
    with across(link_program, quality, vga_rig, tmp_path, *options) as run:
        time.sleep(15)
        color, depth, odom = run.arrivals("/color/image"), run.arrivals("/depth/image"), run.arrivals("cam0/odom")
    settled = odom[0, 1] + 2.0
    found = rate_and_latency(color[color[:, 1] > settled], odom[odom[:, 1] > settled])
    found["depth per second"] = rate_and_latency(depth[depth[:, 1] > settled], odom)["frames per second"]
    print(link, found)
    assert found["frames per second"] > 29.5
    assert found["depth per second"] > 29.5
    assert found["pose latency max ms"] < 100 + quality.delay_ms
