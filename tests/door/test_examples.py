"""Every program of `odom/examples` is short, and does what its first line says."""

import re
import runpy
import subprocess
import sys
import threading
from functools import partial
from itertools import count
from pathlib import Path

import cv2
import numpy as np
import pytest

import odom

PROJECT = Path(__file__).parents[2]
EXAMPLES = PROJECT / "odom" / "examples"
RECORDING = PROJECT / "recordings" / "arena.mcap"


def execute(monkeypatch, capsys, name, *arguments):
    monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
    runpy.run_module(f"odom.examples.{name}", run_name="__main__")
    return capsys.readouterr().out


def test_there_are_five_of_at_most_thirty_lines():
    programs = {path.stem: path.read_text() for path in EXAMPLES.glob("[!_]*.py")}
    assert len(programs) == 5
    for name, text in programs.items():
        assert len(text.splitlines()) <= 30, name
        assert name in Path(__file__).read_text()


def test_numpy_frames(monkeypatch, capsys):
    shown = execute(monkeypatch, capsys, "numpy_frames")
    assert shown.count("TRACKING") == 60
    travelled = float(re.search(r"60 poses, ([\d.]+) m", shown)[1])
    assert abs(travelled - 59 * 2.1 / 525) < 0.003


def test_register_clouds(monkeypatch, capsys):
    shown = execute(monkeypatch, capsys, "register_clouds")
    fitting, error_mm = re.search(r"(\d+) of 300 pairs fit; error ([\d.]+) mm", shown).groups()
    assert 190 <= int(fitting) <= 201
    assert float(error_mm) < 1.5


def test_opencv_capture_without_a_camera(monkeypatch, capsys):
    monkeypatch.setattr(odom, "read_recording", partial(odom.read_recording, end=4.0))
    assert execute(monkeypatch, capsys, "opencv_capture", RECORDING).count("TRACKING") == 30


class Camera:
    """A depth camera as OpenCV shows one, in front of a wall; it ends after ten frames."""

    def __init__(self, *_):
        self.index = -1
        self.wall = np.random.default_rng(0).integers(0, 256, (60, 100), dtype=np.uint8).repeat(8, 0).repeat(8, 1)

    def set(self, *_):
        return True

    def isOpened(self):
        return True

    def grab(self):
        self.index += 1
        return self.index < 10

    def retrieve(self, flag):
        if flag == cv2.CAP_OPENNI_DEPTH_MAP:
            return True, np.full((480, 640), 1500, np.uint16)
        return True, np.dstack([self.wall[:480, self.index : self.index + 640]] * 3)


def test_opencv_capture_with_a_camera(monkeypatch, capsys):
    monkeypatch.setattr(cv2, "VideoCapture", Camera)
    stamps = count(1_700_000_000_000_000_000, 33_333_333)
    monkeypatch.setattr("time.time_ns", lambda: next(stamps))  # steady, however busy the machine is
    assert execute(monkeypatch, capsys, "opencv_capture").count("TRACKING") == 10


def test_plot_with_evo(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))  # evo keeps its settings there
    monkeypatch.setattr(odom, "read_recording", partial(odom.read_recording, end=12.0))
    shown = execute(monkeypatch, capsys, "plot_with_evo", RECORDING, tmp_path / "plot.png")
    by_evo, by_odom = map(float, re.search(r"evo ([\d.]+) m, odom ([\d.]+) m", shown).groups())
    assert by_odom < 0.02
    assert abs(by_evo - by_odom) < 0.1 * by_odom
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_subscribe_poses_to_a_run(tmp_path):
    run = subprocess.Popen(
        [sys.executable, "-m", "odom", "run", RECORDING, "--realtime", "--headless", "--end", "5", "--out", tmp_path],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=PROJECT,
    )
    timer = threading.Timer(120, run.kill)
    timer.start()
    try:
        endpoint = next(found[0] for line in run.stdout if (found := re.search(r"tcp/127\.0\.0\.1:\d+", line)))
        program = [sys.executable, "-m", "odom.examples.subscribe_poses", endpoint]
        shown = subprocess.run(program, check=True, capture_output=True, text=True, cwd=PROJECT, timeout=100).stdout
        run.communicate()
    finally:
        timer.cancel()
        run.kill()
        run.wait()
    assert run.returncode == 0
    published = np.loadtxt(tmp_path / "odometry.txt", usecols=range(4))
    shown_poses = re.findall(r"^([\d.]+) s: ([-\d.]+) ([-\d.]+) ([-\d.]+) m", shown, re.MULTILINE)
    assert len(shown_poses) > 10
    for pose in np.array(shown_poses, dtype=float):
        assert np.abs(published - pose).max(axis=1).min() < 1e-3
