"""Long runs: nothing grows, nothing is lost. Minutes each: `pytest -m slow tests/service`."""

import json
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

Start = Callable[..., "subprocess.Popen[str]"]

FRAMES = 10_000
SETTLED = 2_000
LIMIT_MB = 600


def resident_mb(run: "subprocess.Popen[str]") -> dict[str, float]:
    """Resident memory of the children by their command."""
    children = psutil.Process(run.pid).children()
    return {child.cmdline()[3]: child.memory_info().rss / 2**20 for child in children}


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_memory_is_flat_over_ten_thousand_frames(odom: Start, shared_data: Path, tmp_path: Path) -> None:
    run = odom("run", shared_data / "tum_fr1_xyz", "--headless", "--sensor-option=--loop", "--out", tmp_path)
    settled: dict[str, float] = {}
    while True:
        assert run.poll() is None
        time.sleep(2.0)
        odometry = tmp_path / "odometry.txt"
        frames = len(odometry.read_text().splitlines()) if odometry.exists() else 0
        if not settled and frames >= SETTLED:
            settled = resident_mb(run)
        if frames >= FRAMES:
            break
    last = resident_mb(run)
    run.send_signal(signal.SIGINT)
    assert run.wait(60) == 0
    print("resident MB at", SETTLED, settled, "at", FRAMES, last)
    assert sum(last.values()) <= LIMIT_MB
    for name, megabytes in last.items():
        assert megabytes <= settled[name] + 10, name


@pytest.mark.slow
@pytest.mark.alone
@pytest.mark.timeout(600)
def test_a_minute_at_sixty_hertz_loses_no_frame(odom: Start, shared_data: Path, tmp_path: Path) -> None:
    """A Kinect's recording of 30 Hz played twice as fast, over and over: each frame has half the time."""
    options = ("--realtime", "--rate", "2", "--sensor-option=--loop", "--headless", "--out", tmp_path)
    run = odom("run", shared_data / "tum_fr1_xyz", *options)
    odometry = tmp_path / "odometry.txt"
    while not odometry.exists() or len(odometry.read_text().splitlines()) < 3_600:
        assert run.poll() is None
        time.sleep(1.0)
    run.send_signal(signal.SIGINT)
    assert run.wait(60) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    print({name: report[name] for name in ("frames", "lost_frames", "latency_ms", "cpu_ms_per_frame")})
    assert report["lost_frames"] == 0
    assert report["latency_ms"]["p99"] <= 25.0


@pytest.mark.slow
@pytest.mark.alone
@pytest.mark.timeout(600)
def test_a_live_arena_of_a_minute_loses_no_frame(odom: Start, tmp_path: Path) -> None:
    run = odom("run", "arena", "--live", "--seconds", "60", "--headless", "--out", tmp_path)
    words, _ = run.communicate(timeout=400)
    assert run.returncode == 0, words
    report = json.loads((tmp_path / "report.json").read_text())
    print(
        {name: report[name] for name in ("frames", "lost_frames", "unmatched_frames", "latency_ms", "cpu_ms_per_frame")}
    )
    assert report["lost_frames"] == report["unmatched_frames"] == 0
    assert report["frames"] >= 1790
