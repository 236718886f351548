"""`import odom` is all that a program needs, and costs nothing until a name is used."""

import ast
import doctest
import json
import subprocess
import sys
import tomllib
from dataclasses import fields
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import odom

PROJECT = Path(__file__).parents[2]
CLOUD = np.random.default_rng(0).normal(size=(400, 3))
HEAVY = ("numpy", "numba", "cv2", "scipy", "zenoh", "gtsam", "rerun", "pydantic")


def test_importing_costs_nothing_and_every_name_is_offered():
    program = "import sys, json, odom; names = dir(odom); print(json.dumps([names, sorted(sys.modules)]))"
    shown = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True, cwd=PROJECT)
    names, modules = json.loads(shown.stdout)
    assert set(odom.__all__) <= set(names)
    assert not set(HEAVY) & set(modules)


@pytest.mark.parametrize("name", odom.__all__)
def test_every_name_is_there_and_documented(name):
    value = getattr(odom, name)
    assert value is getattr(odom, name)
    assert name == "__version__" or len(value.__doc__.split()) > 4


def test_what_a_program_reads_off_an_estimate_is_explained():
    for value in (odom.Estimate, odom.RelativePose, odom.TrajectoryPose):
        assert not {field.name for field in fields(value) if f"`{field.name}`" not in value.__doc__}
    assert "nanoseconds" in odom.Stamp.__doc__
    assert all(f"{state.name}:" in odom.State.__doc__ for state in odom.State)
    assert all(f"| {state.name} |" in (PROJECT / "README.md").read_text() for state in odom.State)


def test_names_for_editors_are_those_that_are_there():
    tree = ast.parse((PROJECT / "odom" / "__init__.py").read_text())
    guarded = next(node for node in tree.body if isinstance(node, ast.If))
    imported = {alias.name for node in guarded.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert imported == set(odom.__all__) - {"__version__"}
    defined = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert "__getattr__" not in defined  # a type checker would take every misspelt name for one that is there
    assert (PROJECT / "odom" / "py.typed").is_file()


def test_files_that_the_code_reads_are_installed_with_it():
    packaged = tomllib.loads((PROJECT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    for path in [*(PROJECT / "odom").rglob("*"), *(PROJECT / "sensors").rglob("*")]:
        if path.is_file() and path.suffix not in (".py", ".md", ".service") and "__pycache__" not in path.parts:
            package = ".".join(path.relative_to(PROJECT).parts[:-1])
            assert any(path.match(pattern) for pattern in packaged.get(package, ())), path


def test_a_name_that_is_not_there_is_no_attribute():
    with pytest.raises(AttributeError, match="Odomtry"):
        odom.Odomtry  # noqa: B018


@pytest.mark.parametrize("name", ["odom", "odom.frame.camera", "odom.frame.rgbd", "odom.frame.stamp"])
def test_the_examples_in_docstrings_do_what_they_say(name):
    failed, attempted = doctest.testmod(import_module(name))
    assert failed == 0
    assert attempted > 0


SHOWN = {
    "RgbdFrame": lambda: odom.RgbdFrame(0, 0, np.zeros((480, 640), np.uint8), 0, np.zeros((480, 640), np.uint16)),
    "Pairs": lambda: odom.Pairs(*np.zeros((2, 400, 3)), *np.ones((2, 400, 3))),
    "Prior": lambda: odom.Prior(np.eye(4), np.eye(6)),
    "Registration": lambda: odom.register(odom.Pairs(CLOUD, CLOUD, None, np.full((400, 3), 1e-6))),
    "Trajectory": lambda: odom.Trajectory(np.arange(100), np.tile(np.eye(4), (100, 1, 1))),
    "Camera": lambda: odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5),
    "TrajectoryPose": lambda: odom.TrajectoryPose(5, np.eye(4), 0),
    "Estimate": lambda: odom.Estimate(
        0,
        5,
        odom.State.TRACKING,
        "",
        0,
        np.eye(4),
        np.eye(4),
        np.eye(6),
        step=odom.RelativePose(4, np.eye(4), np.eye(6)),
        timings_ms=dict.fromkeys("abcdefgh", 1.0),
    ),
}
"""What makes a value of each type: in the test, since registering compiles loops for seconds when it is done first."""


@pytest.mark.parametrize("name", SHOWN)
def test_a_value_is_shown_on_one_short_line(name):
    value = SHOWN[name]()
    shown = repr(value)
    assert type(value).__name__ == name
    assert shown.startswith(name)
    assert "\n" not in shown
    assert "array(" not in shown
    assert len(shown) < 500


def test_a_recording_gives_camera_frames_and_truth():
    recording = odom.read_recording(PROJECT / "recordings" / "arena.mcap", end=1.0)
    frames = list(recording)
    assert len(frames) == 8
    assert [frame.sequence for frame in recording] == [frame.sequence for frame in frames]  # it can be read again
    assert frames[0].color.shape == (recording.camera.height, recording.camera.width, 3)
    truth = recording.truth()
    assert list(truth) == ["kinect"]
    assert truth["kinect"].duration_s > 30


@pytest.mark.parametrize("times", [{"start": 1000.0}, {"start": 1000.0, "end": 1001.0}])
def test_a_part_beyond_the_end_of_a_recording_is_refused_as_such(shared_data, times):
    with pytest.raises(odom.RecordingError, match=r"no image from 1000 s to .*length"):
        odom.read_recording(shared_data / "tum_fr1_xyz", **times)


def test_a_calibration_of_another_size_than_the_images_is_refused(shared_data, tmp_path):
    matrix = "camera_matrix: {rows: 3, cols: 3, data: [260, 0, 160, 0, 260, 120, 0, 0, 1]}"
    (tmp_path / "small.yaml").write_text(f"image_width: 320\nimage_height: 240\n{matrix}\ndepth_scale: 5000\n")
    with pytest.raises(odom.RecordingError, match="not of the calibration's 320 x 240 pixels"):
        odom.read_recording(shared_data / "tum_fr1_xyz", tmp_path / "small.yaml", end=1.0)


def test_a_finished_trajectory_is_judged_in_two_calls():
    poses = [odom.TrajectoryPose(i * 10**8, None if i == 3 else np.eye(4), 0) for i in range(20)]
    for i, pose in enumerate(poses):
        if pose.T_map_camera is not None:
            pose.T_map_camera[:3, 3] = i, np.sin(i), 0
    estimate = odom.Trajectory.of(poses)
    assert len(estimate) == 19
    report = odom.evaluate(estimate, estimate)
    assert report.ate_m < 1e-9
    assert "array(" not in repr(report)
    assert len(odom.Trajectory.of([])) == 0


def test_what_is_no_recording_is_refused_by_name(tmp_path):
    with pytest.raises(odom.SourceError, match=r"nothing\.mcap.*recording, ROS bag or folder of images"):
        odom.read_recording(tmp_path / "nothing.mcap")
    with pytest.raises(odom.SourceError, match="arena"):
        odom.read_recording("arena")  # the simulated laboratory is no file
    with pytest.raises(odom.ConfigError, match="neither"):
        odom.read_recording(tmp_path)
