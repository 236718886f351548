"""Shutters that are not what was expected: global ones, and rolling ones that are read upwards."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import PERIOD, SMALL, PaintedRoom, known_readout, stroll
from running import check_sanity, run
from sensor_models import sensor_model

from odom.backend.mapping.shutter_kind import ShutterKind
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3

ROOM = PaintedRoom(half_size=(0.9, 0.7, 1.3))
READOUT_S = 0.024


def pose(t):
    """T_room_camera `t` seconds after the stamp of frame 0, in a walk of half a metre and half a radian a second."""
    return stroll(1.5 * t)


def rolled(frames, readout_s):
    """The first frames of a camera whose rows are read one after the other, complete at their stamps."""
    start_s = abs(readout_s) / 2.0
    return [ROOM.rolled_frame(SMALL, k, lambda t: pose(t - start_s), readout_s) for k in range(frames)]


@pytest.fixture(scope="module")
def global_ran():
    return run(SMALL, [ROOM.frame(SMALL, k, pose(k * PERIOD * 1e-9)) for k in range(110)])


@pytest.fixture(scope="module")
def upwards_ran():
    return run(SMALL, rolled(110, -READOUT_S))


def error(poses, first, last):
    """The error (6) of the motion between two of the T_fixed_camera `poses`."""
    truth = se3.inverse(pose(first * PERIOD * 1e-9)) @ pose(last * PERIOD * 1e-9)
    return se3.log(se3.inverse(se3.inverse(poses[first]) @ poses[last]) @ truth)


def test_published_poses_begin_where_the_camera_was_at_the_first_stamp():
    ran = run(SMALL, rolled(20, READOUT_S), known_readout(READOUT_S))
    check_sanity(ran)
    published = [e.T_odom_camera for e in ran.estimates]
    since_middle_row = np.linalg.norm(se3.log(se3.inverse(pose(0.0)) @ pose(READOUT_S / 2.0)))
    assert since_middle_row > 0.006
    for last in (1, 2, 5, 19):
        assert np.linalg.norm(error(published, 0, last)) < 0.15 * since_middle_row


def test_the_final_poses_of_a_global_shutter_are_as_good_before_that_was_known(global_ran):
    check_sanity(global_ran)
    final = [p.T_map_camera for p in global_ran.final]
    assert max(np.linalg.norm(error(final, first, 100)[:3]) for first in range(0, 30, 3)) < 0.001


def test_the_covariance_since_the_start_allows_for_a_shutter_that_is_not_known(global_ran):
    published = [e.T_odom_camera for e in global_ran.estimates]
    chi2 = [
        (off := error(published, 0, k)) @ np.linalg.solve(global_ran.estimates[k].covariance, off)
        for k in range(2, 110, 3)
    ]
    assert np.median(chi2) < 12.6  # chi-squared with 6 degrees of freedom, 95 %


def test_rows_that_are_read_upwards_are_found(upwards_ran):
    ran = upwards_ran
    check_sanity(ran)
    np.testing.assert_array_less(np.abs(1e3 * ran.timing.vector - (-24.0, -12.0, -24.0)), (3.0, 3.0, 4.0))
    final = [p.T_map_camera for p in ran.final]
    assert max(np.linalg.norm(error(final, first, 100)[:3]) for first in range(0, 110, 3)) < 0.003


def test_the_map_becomes_that_of_the_kind_that_is_found_at_once(upwards_ran):
    estimates = upwards_ran.estimates[:60]  # it is found after a second
    inliers = np.array([e.inliers for e in estimates[1:]])
    assert inliers.min() > 0.5 * np.median(inliers)
    published = [e.T_odom_camera for e in estimates]
    wrong_m = [np.linalg.norm(error(published, k - 1, k)[:3]) for k in range(1, len(published))]
    assert np.count_nonzero(np.array(wrong_m) > 0.002) <= 1  # the step to the new map


def kinds(readout_s=0.024, sigma_s=0.007):
    """The kinds of shutters of a sensor whose readout is expected to be that."""
    sensor = sensor_model(SMALL, ShutterTiming(readout_s, -0.015, 0.012))
    information = np.diag(np.array([sigma_s, 0.008, 0.012]) ** -2.0)
    return ShutterKind.expected(replace(sensor, timing_information=information))


def readouts(kind):
    return kind.beforehand.timing.readout_s, *(other.timing.readout_s for other in kind.others)


def test_all_rows_at_once_and_rows_read_the_other_way_round_may_be_instead_of_what_is_expected():
    assert readouts(kinds()) == (0.024, 0.0, -0.024)
    assert readouts(kinds(-0.024)) == (-0.024, 0.0, 0.024)
    middles_s = [other.timing.since_middle_s + other.timing.depth_lag_s for other in kinds().others]
    np.testing.assert_allclose(middles_s, -0.003)


def test_a_readout_that_is_known_well_is_not_doubted():
    assert readouts(kinds(sigma_s=0.002)) == (0.024,)
    assert readouts(kinds(0.0)) == (0.0,)


def test_another_kind_is_believed_where_it_explains_much_more_and_what_explains_much_less_is_dropped():
    assert readouts(kinds().after([500.0, 490.0, 520.0])) == (0.024, 0.0, -0.024)
    assert readouts(kinds().after([500.0, 510.0, 650.0])) == (0.024, 0.0)
    assert readouts(kinds().after([500.0, 700.0, 450.0])) == (-0.024, 0.024, 0.0)
    assert readouts(kinds().after([])) == (0.024, 0.0, -0.024)


def test_a_kinect_that_hangs_upside_down_is_found_and_nearly_as_accurate_as_where_it_was_said(
    hanging_desk, hanging_desk_ran
):
    camera, frames, truth = hanging_desk
    found = run(camera, frames)
    assert -0.030 < found.timing.readout_s < -0.018
    assert found.judged(truth).ate_m < 1.3 * hanging_desk_ran.judged(truth).ate_m
