"""A scene in which much moves is refused, and a little of it does not change a good calibration."""

from dataclasses import replace

import numpy as np
import pytest

from odom.calibration.adjustment import FREE, Prior, System, likely_gain
from odom.calibration.parameters import prior_sigma, vector_of
from odom.calibration.pixel_error import significant_error_px
from odom.calibration.result import calibrated, restless_share
from odom.calibration.tuning import TUNING
from tests.calibration.made_up_walk import SHEET, made_up_survey, spoilt

POOR = {"fx": 15.0, "k1": 0.1}


@pytest.mark.parametrize("numbers", [{}, POOR])
@pytest.mark.parametrize("moving", [0.1, 0.3, 0.5, 0.7])
def test_what_moves_is_counted(numbers, moving):
    survey = made_up_survey(spoilt(**numbers), points=150, moving=moving)
    assert restless_share(survey, calibrated(survey, SHEET)) > TUNING.restless_most


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("numbers", [{}, POOR])
def test_a_scene_that_stands_still_is_not_taken_for_one_that_moves(numbers, seed):
    survey = made_up_survey(spoilt(**numbers), points=150, seed=seed)
    assert restless_share(survey, calibrated(survey, SHEET)) < 0.2 * TUNING.restless_most


@pytest.mark.parametrize("moving", [0.04, 0.1, 0.3])
def test_a_body_that_walks_by_does_not_make_a_good_calibration_poor(moving):
    survey = made_up_survey(spoilt(), points=250, moving=moving)
    assert likely_gain(System.at_start(survey, FREE), Prior(vector_of(SHEET), prior_sigma(SHEET))) < TUNING.accept_gain
    found = calibrated(survey, SHEET)
    assert significant_error_px(SHEET, found.camera, found.sigma, survey) < 0.5


def test_a_poor_calibration_has_something_to_gain_and_a_good_one_has_not():
    prior = Prior(vector_of(SHEET), prior_sigma(SHEET))
    surveys = [made_up_survey(spoilt(**numbers), points=250) for numbers in ({}, POOR)]
    gains = [likely_gain(System.at_start(survey, FREE), prior) for survey in surveys]
    assert gains[0] < 0.1 * TUNING.accept_gain
    assert gains[1] > TUNING.accept_gain


@pytest.mark.long
def test_landmarks_that_something_alike_was_taken_for_are_none_that_move():
    survey = made_up_survey(spoilt(fx=10.0, k1=0.1), points=200)
    rng = np.random.default_rng(1)
    is_other = rng.random(len(survey.landmarks)) < 0.2
    aside = is_other[survey.landmark] & (np.arange(len(survey)) % 5 > 0)
    seen = replace(survey, uv=survey.uv + rng.choice([-4.0, 4.0], survey.uv.shape) * aside[:, None])
    assert restless_share(seen, calibrated(seen, SHEET)) > TUNING.restless_most
    told = replace(seen, is_displaced=aside)
    assert restless_share(told, calibrated(told, SHEET)) < 0.5 * TUNING.restless_most
