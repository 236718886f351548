"""A run mends a poor calibration at its end, keeps a good one, and never touches what was published."""

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
from odom.evaluation.files import read_tum
from odom.service.calibration_offer import offer_calibration
from odom.service.run_calibration import calibration_fields
from sensors.default_camera import kinect_camera
from tests.calibration.made_up_walk import SHEET, made_up_survey, spoilt
from tests.ran_here import ate_m, run_here

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


@pytest.mark.long
def test_from_an_average_kinect_a_run_comes_near_to_its_own_sheet_and_from_the_sheet_it_is_no_worse(shared_data):
    recording = read_recording(shared_data / "tum_fr1_rpy_part")
    kept, sheet = (run_here(recording, calibrates=calibrates) for calibrates in (False, True))
    mended = run_here(recording, kinect_camera(640, 480))
    kept_m, sheet_m, mended_m = (ate_m(each.final, recording) for each in (kept, sheet, mended))
    kept_online_m, sheet_online_m, mended_online_m = (ate_m(each.online, recording) for each in (kept, sheet, mended))
    print(
        {
            "as given": (kept_m, kept_online_m),
            "sheet": (sheet_m, sheet_online_m),
            "average": (mended_m, mended_online_m),
        }
    )
    assert sheet_m <= 1.03 * kept_m
    assert mended_m <= 1.25 * kept_m
    assert sheet_online_m <= 1.03 * kept_online_m
    assert mended_online_m <= 1.5 * kept_online_m
    assert mended.own.found is not None
    start, now, sigma = calibration_fields(mended.odometry, mended.own)["calibration"]["cy"]
    assert start == 239.5
    assert abs(now - 239.5) > 3 * sigma
    assert mended.own.found.camera.cy == pytest.approx(now, abs=1e-3)


@pytest.mark.long
def test_an_exact_calibration_is_kept_and_said_to_be(tmp_path):
    """The final trajectory is that of a command which is told to calibrate nothing."""
    source = Path(__file__).parents[2] / "recordings" / "arena.mcap"
    kept = run_here(read_recording(source, end=16))
    assert "good" in kept.own.reason
    assert kept.odometry.camera_in_use is kept.odometry.camera
    fields = calibration_fields(kept.odometry, kept.own)
    assert fields["calibration_kept"] == kept.own.reason
    assert fields["calibration"]["fx"][0] == fields["calibration"]["fx"][1] == 262.5
    offer_calibration(kept.own, tmp_path)
    assert not any(tmp_path.iterdir())
    config = tmp_path / "off.yaml"
    config.write_text("odometry: {self_calibration: false}\n")
    command = [sys.executable, "-m", "odom", "run", source, "--end", 16, "--config", config, "--headless"]
    subprocess.run([*map(str, command), "--out", tmp_path / "off"], capture_output=True, timeout=250, check=True)
    off = read_tum(tmp_path / "off" / "trajectory.txt")
    np.testing.assert_array_equal(off.stamps, kept.final.stamps)
    np.testing.assert_allclose(off.T_world_body, kept.final.T_world_body, rtol=0, atol=1e-8)
