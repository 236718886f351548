"""`odom calibrate` as a user calls it: what it refuses, and why."""

import os
import subprocess
import sys
from pathlib import Path

RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"
COMMAND = [sys.executable, "-m", "odom", "calibrate"]


def calibrate(*arguments, timeout=580):
    done = subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=timeout, env=os.environ, check=False
    )
    return done.returncode, done.stdout, done.stderr


def test_a_camera_at_rest_shows_nothing_and_nothing_is_written(tmp_path):
    out = tmp_path / "camera.yaml"
    status, text, errors = calibrate("arena", "--seconds", "2", "--option", "walk=rest", "--out", out)
    assert status == 1, errors
    assert not out.exists()
    assert "not shown by this walk" in text or "walk on" in errors


def test_another_name_than_yaml_is_refused(tmp_path):
    status, _, errors = calibrate(RECORDING, "--out", tmp_path / "camera.txt")
    assert status == 2
    assert ".yaml" in errors
