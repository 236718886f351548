"""A map whose disk was full for a moment is whole in the end, and so is the run that wrote it."""

import json
import subprocess
import threading
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from odom.map_file.map_file import MapFile

Start = Callable[..., "subprocess.Popen[str]"]
RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"
TOO_SMALL = 100_000
"""Bytes that hold the lines of a short run and an empty map, but no key frame."""


@pytest.mark.long
def test_a_run_whose_map_could_not_be_written_for_a_moment_does_not_fail(
    odom: Start, eventually: Callable[..., None], tmp_path: Path
) -> None:
    out, path = tmp_path / "out", tmp_path / "lab.map"
    run = odom("run", RECORDING, "--end", "3", "--realtime", "--headless", "--out", out, "--map", path)
    words: list[str] = []
    reading = threading.Thread(target=lambda: words.extend(run.stdout or ()), daemon=True)
    reading.start()
    eventually(path.exists, 60, "the map is begun")
    (odometry,) = (c for c in psutil.Process(run.pid).children() if "serve" in c.cmdline())
    before = odometry.rlimit(psutil.RLIMIT_FSIZE)
    odometry.rlimit(psutil.RLIMIT_FSIZE, (TOO_SMALL, before[1]))
    eventually(lambda: f"{path} cannot be written" in "".join(words), 60, "the full disk is told")
    odometry.rlimit(psutil.RLIMIT_FSIZE, before)
    assert run.wait(60) == 0, words
    reading.join()
    assert "".join(words).count(f"{path} is written again") == 1
    assert json.loads((out / "report.json").read_text())["unwritten"] == 0
    assert MapFile(path, is_written=False).check_readable() > 1
