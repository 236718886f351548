"""`odom export` as its users meet it, on recordings."""

import json
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import psutil
import pytest
from painted_room import SMALL
from refused import process_as_it_was
from room_survey import exact_survey
from typer.testing import CliRunner

from odom.backend import OdometrySettings, TrajectoryPose
from odom.cli import app
from odom.errors import OdomError
from odom.evaluation.alignment import align
from odom.evaluation.report import evaluate
from odom.export.rectify import pinhole_of
from odom.export.scene import scene_of
from odom.export.views import survey
from odom.export.writing import Exporter, ExportOptions
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3
from odom.rgbd_recording import read_recording

PROJECT = Path(__file__).parents[2]
RECORDING = PROJECT / "recordings" / "arena.mcap"


def export(*arguments, status=0):
    words = [sys.executable, "-m", "odom", "export", *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=PROJECT, timeout=500)
    assert done.returncode == status, done.stderr
    return done.stdout + done.stderr


def surveyed(recording):
    return survey(recording, OdometrySettings(), lambda done: None, lambda: False)


def test_a_recording_becomes_images_with_poses(tmp_path):
    words = export(RECORDING, "--end", "6", "--to", "nerfstudio", "--out", tmp_path / "out")
    frames = json.loads((tmp_path / "out" / "transforms.json").read_text())["frames"]
    assert f"{len(frames)} key frames" in words
    assert len(frames) > 5
    for frame in frames:
        assert (tmp_path / "out" / frame["file_path"]).is_file()
        assert (tmp_path / "out" / frame["depth_file_path"]).is_file()
    refused = export(RECORDING, "--to", "tum", "--out", tmp_path / "out", status=2)
    assert "new or empty folder" in refused


def test_a_folder_of_a_run_becomes_a_trajectory_and_nothing_else(tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    (run / "trajectory.txt").write_text("1.0 0 0 0 0 0 0 1\n2.0 1 0 0 0 0 0 1\n")
    export(run, "--to", "kitti", "--out", tmp_path / "out")
    assert np.loadtxt(tmp_path / "out" / "poses.txt")[1].tolist() == [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0]
    assert "give the recording" in export(run, "--to", "ply", "--out", tmp_path / "other", status=2)
    assert not (tmp_path / "other").exists()


def test_runs_whose_folders_differ_behind_a_point_are_exported_together(tmp_path):
    runs = [tmp_path / "run.1", tmp_path / "run.2"]
    for run in runs:
        run.mkdir()
        (run / "trajectory.txt").write_text("1.0 0 0 0 0 0 0 1\n2.0 1 0 0 0 0 0 1\n")
    export(*runs, "--to", "tum", "--out", tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["run.1", "run.2"]


def test_the_counts_are_those_of_what_is_written_and_say_that_it_is_a_part(tmp_path, monkeypatch):
    whole = exact_survey()
    keyframes = whole.scene.keyframes[:4]
    part = replace(whole.scene, trajectory=whole.scene.trajectory.take(np.arange(40)), keyframes=keyframes, parts=2)
    monkeypatch.setattr("odom.export.views.survey", lambda *_: replace(whole, scene=part))
    with process_as_it_was():
        done = CliRunner().invoke(app, ["export", str(RECORDING), "--to", "tum", "--out", str(tmp_path / "out")])
    seen = len(np.unique(np.concatenate([keyframe.landmarks for keyframe in keyframes])))
    assert seen < len(whole.scene.points)
    assert f"40 of 61 frames, the largest of 2 parts: 4 key frames, {seen} landmarks" in done.output
    assert len((tmp_path / "out" / "trajectory.txt").read_text().splitlines()) >= 40


def test_the_folder_of_a_run_in_parts_says_that_the_largest_is_written(tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    lines = [f"{i}.0 0 0 0 0 0 0 1\n" for i in range(1, 6)]
    (run / "trajectory.txt").write_text("".join(["# segment 0\n", *lines[:2], "# segment 1\n", *lines[2:]]))
    assert "the largest of 2 parts" in export(run, "--to", "tum", "--out", tmp_path / "out")


def test_a_scene_is_of_the_largest_of_the_parts_that_it_counts():
    poses = [TrajectoryPose(Stamp(i), np.eye(4), int(i > 2)) for i in range(8)]
    none = np.zeros(0, dtype=bool)
    landmarks = SimpleNamespace(alive=none, is_vague=lambda rows: none, position=np.zeros((0, 3)))
    empty = SimpleNamespace(
        members=lambda segment: [], landmarks=landmarks, registrations=SimpleNamespace(among=lambda keys: [])
    )
    scene = scene_of(SMALL, ShutterTiming(), poses, empty)
    assert (len(scene.trajectory), scene.parts, scene.landmarks_seen) == (5, 2, 0)


def test_what_a_mask_or_the_setting_marks_is_left_out(tmp_path):
    marked = np.zeros((480, 640), dtype=np.uint8)
    marked[240:] = 255
    cv2.imwrite(str(tmp_path / "mask.png"), marked)
    (tmp_path / "odom.yaml").write_text(f"service: {{mask: {tmp_path / 'mask.png'}}}")
    ways = {"plain": (), "option": ("--mask", tmp_path / "mask.png"), "setting": ("--config", tmp_path / "odom.yaml")}
    written = {}
    for name, arguments in ways.items():
        export(RECORDING, "--end", "1", "--to", "tum", "--out", tmp_path / name, *arguments)
        written[name] = (tmp_path / name / "trajectory.txt").read_text()
    assert written["option"] == written["setting"] != written["plain"]


def test_an_interruption_leaves_what_was_read_and_says_what_was_not_exported(tmp_path, monkeypatch):
    stop = threading.Event()
    stop.set()
    shutil.copy(RECORDING, tmp_path / "other.mcap")
    with process_as_it_was():
        monkeypatch.setattr("odom.cli.signals.stop_event", lambda: stop)
        words = ["export", RECORDING, tmp_path / "other.mcap", "--to", "tum", "--out", tmp_path / "out"]
        done = CliRunner().invoke(app, [str(word) for word in words])
        assert isinstance(done.exception, OdomError)
        assert str(done.exception) == "interrupted: 1 of 2 sources were not exported"
        last = CliRunner().invoke(app, [str(word) for word in (*words[:1], *words[2:-1], tmp_path / "last")])
    assert f"{tmp_path / 'out' / 'arena'} (of what was read until the interruption)" in done.output
    assert (tmp_path / "out" / "arena" / "trajectory.txt").is_file()
    assert last.exit_code == 0, last.exception


def distance_to(surfaces, points):
    """Distances (n, m) of points to the nearest of the parallelograms of a scene."""
    nearest = np.full(len(points), np.inf)
    for origin, u, v in zip(surfaces.origin, surfaces.u, surfaces.v, strict=True):
        across, down = (np.clip((points - origin) @ side / (side @ side), 0, 1) for side in (u, v))
        apart = points - origin - across[:, None] * u - down[:, None] * v
        nearest = np.minimum(nearest, np.linalg.norm(apart, axis=1))
    return nearest


@pytest.mark.slow
def test_the_arenas_mesh_lies_on_its_surfaces(tmp_path):
    open3d = pytest.importorskip("open3d", reason="pip install 'rgbd-odom[dense]'")
    from sensors.arena import rooms
    from sensors.arena.camera_path import make_walk
    from sensors.arena.options import ArenaOptions

    recording = read_recording(RECORDING)
    found = surveyed(recording)
    Exporter(tmp_path, found, recording, ExportOptions(), say=print).write_mesh()
    trajectory, options = found.scene.trajectory, ArenaOptions(seed=1)
    walk = make_walk(options)
    true = np.array([walk.T_world_camera((stamp - options.start) * 1e-9)[:3, 3] for stamp in trajectory.stamps])
    T_world_map = align(trajectory.positions, true).T_truth_estimate
    mesh = open3d.io.read_triangle_mesh(str(tmp_path / "mesh.ply"))
    vertices = np.asarray(mesh.vertices)
    some = np.random.default_rng(0).choice(len(vertices), 20_000, replace=False)
    off = distance_to(rooms.laboratory(1)._surfaces, se3.apply(T_world_map, vertices[some]))
    print(f"{len(vertices)} vertices, {(off < 0.02).mean():.1%} within 2 cm, median {1e3 * np.median(off):.1f} mm")
    assert (off < 0.02).mean() >= 0.95


@pytest.mark.slow
def test_colmap_finds_the_desks_landmarks_where_they_were_seen(tmp_path, shared_data):
    pycolmap = pytest.importorskip("pycolmap", reason="pip install pycolmap")
    recording = read_recording(shared_data / "tum_fr1_xyz")
    found = surveyed(recording)
    for unroll in (False, True):
        folder = tmp_path / f"unroll-{unroll}"
        folder.mkdir()
        Exporter(folder, found, recording, ExportOptions(unroll=unroll)).write_colmap()
        read = pycolmap.Reconstruction(folder / "sparse" / "0")
        read.update_point_3d_errors()
        error_px = read.compute_mean_reprojection_error()
        print(f"unroll {unroll}: {read.num_images()} images, {read.num_points3D()} points, {error_px:.3f} px")
        assert read.num_images() == len(found.scene.keyframes) > 5
        assert read.num_points3D() > 200
    assert error_px <= 1.2  # of the images as they are exported unless asked otherwise


@pytest.mark.slow
def test_a_hundred_and_fifty_key_frames_become_a_mesh_in_time_and_memory(shared_data):
    pytest.importorskip("open3d", reason="pip install 'rgbd-odom[dense]'")
    from odom.export.mesh import Volume
    from odom.export.surface import surface_depth

    recording = read_recording(shared_data / "tum_fr1_xyz")
    poses = surveyed(recording).scene
    every = len(poses.trajectory) // 150
    frames = [frame for k, frame in enumerate(recording) if k % every == 0][:150]
    shots = [
        (surface_depth(frame.depth_mm, 4.0), frame.color, poses.pose_of_depth(frame.depth_stamp)) for frame in frames
    ]
    process = psutil.Process()
    before = process.memory_info().rss
    begun, begun_cpu = time.perf_counter(), time.process_time()
    volume = Volume(pinhole_of(recording.camera), 0.01, 4.0)
    for depth_mm, _, T in shots:
        volume.look(depth_mm, T)
    made = volume.mesh(iter(shots))
    took_s, more_mb = time.perf_counter() - begun, (process.memory_info().rss - before) / 2**20
    cpu_s = time.process_time() - begun_cpu
    print(
        f"{len(shots)} key frames: {took_s:.1f} s ({cpu_s:.1f} s CPU), {more_mb:.0f} MB, of {volume.memory_mb:.0f} MB"
    )
    assert len(shots) == 150
    assert len(made.triangles) > 10_000
    assert took_s <= 12
    assert more_mb <= 1500


@pytest.mark.long
def test_a_poor_calibration_is_bettered_before_anything_is_exported(shared_data):
    """As `odom run` does it: focal lengths are six per cent off, the image's centre eight pixels."""
    turning = read_recording(shared_data / "tum_fr1_rpy_part")
    good = turning.camera
    poor = replace(turning, camera=replace(good, fx=1.06 * good.fx, fy=1.06 * good.fy, cx=good.cx + 8.0))
    found = surveyed(poor)
    assert found.off_px > 3.0
    assert found.camera.fx == pytest.approx(good.fx, rel=0.025)
    assert found.camera.cx == pytest.approx(good.cx, abs=2.0)
    assert evaluate(found.scene.trajectory, turning.truth()["camera"]).ate_m < 0.009  # .0067; .0127 with the poor one


def test_a_calibration_is_kept_where_it_is_to_be_kept(shared_data):
    turning = read_recording(shared_data / "tum_fr1_rpy_part", end=2.0)
    settings = OdometrySettings(self_calibration=False)
    found = survey(turning, settings, lambda done: None, lambda: False)
    assert (found.camera, found.off_px) == (turning.camera, None)
