"""A run mends a poor calibration at its end, keeps a good one, and never touches what was published."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from odom import Odometry, read_recording
from odom.calibration.parameters import NAMES
from odom.calibration.pixel_error import significant_error_px
from odom.calibration.self_calibration import self_calibrated
from sensors.calibration_file import Calibration, calibration_text, load_calibration
from sensors.default_camera import kinect_camera
from tests.calibration.made_up_walk import SHEET, made_up_survey, spoilt

SURVEY = made_up_survey(spoilt())
UNSURE = np.zeros(len(NAMES))


def test_a_camera_is_not_off_from_itself():
    assert significant_error_px(SHEET, SHEET, UNSURE, SURVEY) == pytest.approx(0.0, abs=1e-6)


def test_a_focal_length_one_percent_off_shows_as_pixels_and_a_turned_camera_hardly():
    longer = replace(SHEET, fx=1.01 * SHEET.fx, fy=1.01 * SHEET.fy)
    assert 1.0 < significant_error_px(SHEET, longer, UNSURE, SURVEY) < 3.0
    aside = replace(SHEET, cx=SHEET.cx + 5.0)  # nearly what a turn by half a degree would do
    assert significant_error_px(SHEET, aside, UNSURE, SURVEY) < 1.0


def test_depth_beside_colour_counts_as_far_as_it_is_sure():
    depth = replace(SHEET.depth, shift_px=(5.0, 3.0))
    sure = significant_error_px(SHEET, replace(SHEET, depth=depth), UNSURE, SURVEY)
    unsure = significant_error_px(SHEET, replace(SHEET, depth=depth), np.full(len(NAMES), 2.0), SURVEY)
    assert 4.5 < sure < np.hypot(5.0, 3.0)
    assert 0.0 < unsure < sure - 0.5


@given(most=st.integers(30, 6000), seed=st.integers(0, 5))
def test_landmarks_drawn_by_chance_bring_all_their_observations(most, seed):
    few = SURVEY.thinned(most, seed)
    count = np.bincount(few.landmark, minlength=len(few.landmarks))
    assert count.min() >= 3
    assert len(few) <= most + count.max()
    assert set(map(tuple, few.landmarks)) <= set(map(tuple, SURVEY.landmarks))
    assert (np.diff(few.landmark) >= 0).all()


@given(most=st.integers(1, 60))
def test_the_newest_frames_are_the_newest_and_one_is_held(most):
    newest = SURVEY.newest(most)
    assert len(newest.T_camera_map) == min(most, len(SURVEY.T_camera_map))
    assert newest.is_fixed.any()
    assert newest.frame.max() < len(newest.T_camera_map)
    np.testing.assert_array_equal(newest.T_camera_map[-1], SURVEY.T_camera_map[np.argmax(SURVEY.seconds)])


def test_a_walk_too_short_to_say_anything_keeps_its_calibration(shared_data):
    recording = read_recording(shared_data / "tum_fr1_rpy_part", end=0.3)
    odometry = Odometry(recording.camera)
    for frame in recording:
        odometry.process(frame)
    odometry.finish()
    found = self_calibrated(odometry)
    assert found.trajectory is None
    assert "walk on" in found.reason


def run(source: Path, out: Path, *arguments: object) -> dict:
    command = [sys.executable, "-m", "odom", "run", source, "--headless", "--out", out, *arguments]
    done = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, timeout=250, env=os.environ, check=False
    )
    assert done.returncode == 0, done.stderr
    return {"text": done.stdout, **json.loads((out / "report.json").read_text())}


@pytest.mark.long
def test_from_an_average_kinect_a_run_comes_near_to_its_own_sheet_and_from_the_sheet_it_is_no_worse(
    shared_data, tmp_path
):
    source = shared_data / "tum_fr1_rpy_part"
    average = tmp_path / "average.yaml"
    average.write_text(calibration_text(Calibration(kinect_camera(640, 480), 5000.0)))
    kept = run(source, tmp_path / "kept", "--config", _off(tmp_path))
    sheet = run(source, tmp_path / "sheet")
    mended = run(source, tmp_path / "mended", "--camera", average)
    runs = (("as given", kept), ("sheet", sheet), ("average", mended))
    print({name: (one["ate_m"], one["ate_online_m"]) for name, one in runs})
    assert sheet["ate_m"] <= 1.03 * kept["ate_m"]
    assert mended["ate_m"] <= 1.25 * kept["ate_m"]
    assert mended["ate_online_m"] <= 1.5 * kept["ate_online_m"]
    start, now, sigma = mended["calibration"]["cy"]
    assert start == 239.5
    assert abs(now - 239.5) > 3 * sigma
    assert "calibration_kept" not in mended
    assert "camera-calibrated.yaml" in mended["text"]
    assert load_calibration(tmp_path / "mended" / "camera-calibrated.yaml").camera.cy == pytest.approx(now, abs=1e-3)
    assert sheet["ate_online_m"] <= 1.03 * kept["ate_online_m"]


@pytest.mark.long
def test_an_exact_calibration_is_kept_and_said_to_be(tmp_path):
    source = Path(__file__).parents[2] / "recordings" / "arena.mcap"
    kept = run(source, tmp_path / "kept", "--end", 16)
    run(source, tmp_path / "off", "--end", 16, "--config", _off(tmp_path))
    assert "good" in kept["calibration_kept"]
    assert kept["calibration"]["fx"][0] == kept["calibration"]["fx"][1] == 262.5
    assert not (tmp_path / "kept" / "camera-calibrated.yaml").exists()
    final = [(tmp_path / name / "trajectory.txt").read_bytes() for name in ("kept", "off")]
    assert final[0] == final[1]


def _off(folder: Path) -> Path:
    config = folder / "off.yaml"
    config.write_text("odometry: {self_calibration: false}\n")
    return config
