"""A good calibration stays where it is, a poor one moves freely: the walk tells which of the two was given."""

import numpy as np
import pytest
from made_up_walk import SHEET, made_up_survey, spoilt

from odom.calibration.parameters import LENS, TIMINGS, prior_sigma, vector_of
from odom.calibration.result import calibrated

SLOW = slice(TIMINGS, None)
POOR = {"fx": 20.0, "fy": -15.0, "cx": 10.0, "cy": -12.0, "k1": 0.12, "shift_u_px": -3.0}


def width(found) -> float:
    return float(np.median((found.prior.sigma / prior_sigma(SHEET))[found.fitted.free][TIMINGS:]))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_good_calibration_hardly_moves(seed):
    found = calibrated(made_up_survey(vector_of(SHEET), seed=seed, points=150), SHEET)
    off = np.abs(found.vector - found.start)[LENS] / found.sigma[LENS]
    assert off.max() < 1.0
    assert width(found) < 0.1


def test_a_poor_one_is_found_and_its_prior_left_wide():
    truth = spoilt(**POOR)
    found = calibrated(made_up_survey(truth, points=250), SHEET)
    assert width(found) > 0.1
    assert (np.abs(found.vector - truth)[LENS] < 3.0 * found.sigma[LENS]).all()


def test_it_is_nearer_to_the_truth_than_what_was_given_in_either_case():
    for numbers in ({"cx": 2.0}, {"fx": 3.0, "k1": 0.01}, POOR):
        truth = spoilt(**numbers)
        found = calibrated(made_up_survey(truth, points=250), SHEET)
        scale = prior_sigma(SHEET)[SLOW]
        before, after = (np.linalg.norm((v - truth)[SLOW] / scale) for v in (found.start, found.vector))
        assert after < before
