"""A camera is changed in mid-run only where the walk shows another one surely; what is tracked then gains."""

import threading
from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest

from odom import Odometry, Trajectory, read_recording
from odom.backend import OdometrySettings
from odom.calibration.mid_run import MidRunCalibrator, Sureness
from odom.calibration.pixel_error import ray_sigma_px
from odom.calibration.result import as_measured, calibrated
from odom.calibration.self_calibration import SelfCalibration
from odom.evaluation.report import evaluate
from odom.service.run_calibration import final_calibration
from odom.service.startup import ReadyUnlessStopped
from sensors.default_camera import kinect_camera
from tests.calibration.made_up_walk import SHEET, at_rest, made_up_survey, spoilt

POOR = {"fx": 10.0, "fy": 8.0, "cy": 12.0, "k1": 0.15, "k2": -0.3}


def found_in(survey):
    return as_measured(calibrated(survey, SHEET))


def test_a_poor_camera_is_changed_and_a_good_one_is_not():
    poor, good = made_up_survey(spoilt(**POOR)), made_up_survey(spoilt())
    assert Sureness.of(poor, found_in(poor)).is_enough
    assert not Sureness.of(good, found_in(good)).is_enough


def test_fewer_landmarks_leave_the_rays_less_sure():
    unsure = [ray_sigma_px(found_in(made_up_survey(spoilt(**POOR), points=points))) for points in (60, 400)]
    assert 0.05 < unsure[1] < unsure[0]


def test_a_camera_at_rest_changes_nothing():
    survey = made_up_survey(spoilt(**POOR), walk=at_rest)
    assert not Sureness.of(survey, found_in(survey)).is_enough


def test_an_unsure_camera_is_used_only_where_the_one_in_use_is_off_by_far_more():
    assert Sureness(off_px=14.0, own_px=4.0).is_enough
    assert not Sureness(off_px=9.0, own_px=4.0).is_enough
    assert Sureness(off_px=3.4, own_px=1.4).is_enough


def test_the_next_look_comes_soon_where_the_camera_seems_off_and_late_where_it_is_surely_good():
    seems_off, unsure, sure = (Sureness(*px) for px in ((1.5, 1.0), (2.0, 4.0), (0.5, 1.0)))
    assert not seems_off.is_enough
    assert 1.0 < seems_off.again < unsure.again < sure.again
    good = made_up_survey(spoilt())
    assert Sureness.of(good, found_in(good)).again == sure.again


def test_the_centre_alone_hardly_counts_since_the_camera_may_be_turned_in_its_housing():
    found = found_in(made_up_survey(spoilt(**POOR)))
    sigma = found.sigma.copy()
    sigma[5:7] *= 3.0
    assert ray_sigma_px(replace(found, sigma=sigma)) < 2.5 * ray_sigma_px(found)


def test_frames_of_a_live_stream_do_not_wait_until_the_calibrator_is_compiled():
    look = MidRunCalibrator(threading.Event(), may_wait=lambda: False).looked_at(None)
    assert look() is None


def test_a_run_that_is_stopped_does_not_wait_for_the_calibrators_code(monkeypatch):
    stop = threading.Event()
    stop.set()
    calibrator = MidRunCalibrator(ReadyUnlessStopped(stop))
    monkeypatch.setattr("odom.calibration.mid_run.surveyed", lambda odometry: (None, None))
    odometry = SimpleNamespace(camera=SHEET, calibrator=calibrator, settings=OdometrySettings())
    assert calibrator.looked_at(odometry)() is None
    assert "stopped" in final_calibration(odometry, has_map=False, tracked=1.0).reason


@pytest.mark.parametrize(
    ("tracked", "is_changed", "is_kept"), [(0.5, False, True), (0.7, False, False), (0.5, True, False)]
)
def test_a_run_that_was_mostly_lost_offers_no_calibration_unless_it_was_changed_on_the_way(
    monkeypatch, tracked, is_changed, is_kept
):
    found = SelfCalibration(off_px=9.0)
    earlier = found if is_changed else None
    monkeypatch.setattr("odom.service.run_calibration.self_calibrated", lambda odometry, earlier: found)
    monkeypatch.setattr("odom.service.run_calibration.latest_calibration", lambda odometry: earlier)
    odometry = SimpleNamespace(calibrator=None, settings=OdometrySettings())
    final = final_calibration(odometry, has_map=False, tracked=tracked)
    assert (final is not found) == is_kept
    assert ("only 50% of the frames were tracked" in final.reason) == is_kept


@pytest.mark.long
def test_from_an_average_kinect_the_causal_trajectory_errs_less_by_the_camera_found_on_the_way(shared_data):
    """How near it comes to that by the camera's own sheet: see `test_self_calibration`."""
    recording = read_recording(shared_data / "tum_fr1_xyz")
    frames, truth = list(islice(recording, 330)), recording.truth()["camera"]

    def online(calibrator):
        odometry = Odometry(kinect_camera(640, 480), calibrator=calibrator)
        poses = [odometry.process(frame).T_odom_camera for frame in frames]
        return evaluate(Trajectory(np.array([f.stamp for f in frames]), np.array(poses)), truth).ate_m, odometry

    kept, _ = online(None)
    mended, odometry = online(MidRunCalibrator())
    print(f"online ATE by an average camera {kept:.5f}, mended on the way {mended:.5f}")
    assert odometry.camera_in_use is not odometry.camera
    assert mended < 0.85 * kept
