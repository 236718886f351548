"""Recordings of one camera add up; those of two are told apart, with the number that differs."""

import numpy as np
import pytest
from made_up_walk import SHEET, made_up_survey, spoilt

from odom.calibration.parameters import NAMES
from odom.calibration.result import calibrated, judge, restless_share
from odom.calibration.survey import joined
from odom.calibration.tuning import TUNING
from odom.errors import InputError
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera
from odom.service import calibration_run
from odom.service.calibration_run import Walk

STILL = Trajectory(np.arange(3), np.tile(np.eye(4), (3, 1, 1)))
FX = NAMES.index("fx")


def walk_of(survey):
    return Walk(SHEET, survey, STILL, {}, 1.0)


@pytest.mark.long
def test_two_recordings_of_one_camera_make_it_surer():
    truth = spoilt(fx=10.0, cx=4.0)
    one, two = (made_up_survey(truth, seed=seed, points=200) for seed in (1, 2))
    alone, both = calibrated(one, SHEET), calibrated(joined([one, two]), SHEET)
    assert both.sigma[FX] < alone.sigma[FX]
    assert abs(both.vector[FX] - truth[FX]) < 4.0 * both.sigma[FX]
    calibration_run._check_same_camera([walk_of(one), walk_of(two)], SHEET, lambda: False)


def test_two_cameras_are_refused():
    one, other = made_up_survey(spoilt(fx=10.0), points=200), made_up_survey(spoilt(fx=-15.0), points=200)
    with pytest.raises(InputError, match="different cameras"):
        calibration_run._check_same_camera([walk_of(one), walk_of(other)], SHEET, lambda: False)


def test_images_of_two_sizes_are_refused():
    one, other = made_up_survey(spoilt(), points=50), made_up_survey(spoilt(), points=50)
    object.__setattr__(other, "camera", Camera(320, 240, 262.5, 262.5, 159.5, 119.5))
    with pytest.raises(InputError, match="320 x 240"):
        joined([one, other])


@pytest.mark.long
@pytest.mark.parametrize("apart", [20.0, 80.0, 160.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_two_cameras_in_one_recording_change_nothing_or_are_told(apart, seed):
    half = 0.5 * apart
    cameras = [spoilt(fx=side * half, fy=side * half) for side in (1.0, -1.0)]
    mixed = joined([made_up_survey(one, points=150, seed=seed + k) for k, one in enumerate(cameras)])
    found = calibrated(mixed, SHEET)
    if restless_share(mixed, found) <= TUNING.restless_most:
        assert apart < 0.1 * SHEET.fx
        assert not judge(mixed, found).is_better
