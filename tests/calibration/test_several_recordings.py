"""Recordings of one camera add up; those of two are told apart, with the number that differs."""

from dataclasses import replace

import pytest
from made_up_walk import SHEET, made_up_survey, spoilt

from odom.calibration.parameters import NAMES
from odom.calibration.result import calibrated, judge, restless_share
from odom.calibration.same_camera import apart, is_of_another_camera
from odom.calibration.several_recordings import joined
from odom.calibration.tuning import TUNING
from odom.errors import InputError
from odom.frame import Camera
from odom.service import calibration_run
from odom.service.calibration_files import remarks
from odom.service.calibration_run import Outcome

FX = NAMES.index("fx")


@pytest.mark.long
def test_two_recordings_of_one_camera_make_it_surer():
    truth = spoilt(fx=10.0, cx=4.0)
    one, two = (made_up_survey(truth, seed=seed, points=200) for seed in (1, 2))
    alone, both = calibrated(one, SHEET), calibrated(joined([one, two]), SHEET)
    assert both.sigma[FX] < alone.sigma[FX]
    assert abs(both.vector[FX] - truth[FX]) < 4.0 * both.sigma[FX]
    calibration_run._check_same_camera([alone, calibrated(two, SHEET)], is_settled=True)


def test_two_cameras_are_refused():
    one, other = made_up_survey(spoilt(fx=10.0), points=200), made_up_survey(spoilt(fx=-15.0), points=200)
    with pytest.raises(InputError, match="different cameras"):
        calibration_run._check_same_camera([calibrated(one, SHEET), calibrated(other, SHEET)])


@pytest.mark.parametrize(("fx", "is_another"), [(615.0, False), (570.0, False), (350.0, True), (800.0, True)])
def test_a_calibration_is_of_another_camera_where_its_focal_length_is_farther_off_than_any_of_this_one(fx, is_another):
    survey = made_up_survey(spoilt(fx=fx - SHEET.fx, fy=fx - SHEET.fy), points=100)
    assert is_of_another_camera(calibrated(survey, SHEET)) is is_another


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_a_camera_that_is_zoomed_between_two_short_walks_is_told_from_one_that_is_not(seed):
    """By no number surely, but by all of them together."""
    truth, zoomed = spoilt(cy=12.0, k1=0.1), spoilt(fx=8.0, fy=8.0, cy=12.0, k1=0.1)
    first, same, other = (
        calibrated(made_up_survey(vector, seed=seed + more, points=60), SHEET)
        for vector, more in ((truth, 0), (truth, 10), (zoomed, 20))
    )
    assert apart(first, same) < 2.0
    assert apart(first, other) > 3.0


@pytest.mark.long
def test_two_cameras_in_one_recording_are_told():
    """Not refused: the halves of a good walk, too, may differ by what no number of the calibration stands for."""
    one, other = made_up_survey(spoilt(fx=10.0), points=200), made_up_survey(spoilt(fx=-15.0), points=200, seed=1)
    told = {}
    for name, second in (("two", other), ("one", one)):
        survey = joined([one, second])
        outcome = Outcome(SHEET, calibrated(survey, SHEET), survey, None, None, 1)
        outcome = replace(outcome, halves_apart=calibration_run._halves_apart(outcome, lambda: False))
        told[name] = "\n".join(remarks(outcome, ["walk.mcap"]))
    assert "the two halves of the recording show lenses that differ" in told["two"]
    assert "halves" not in told["one"]


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
