"""A good calibration stays where it is, a poor one moves freely: the walk tells which of the two was given."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_walk import SHEET, made_up_survey, spoilt

from odom.calibration.adjustment import FREE, Prior, System, fit
from odom.calibration.parameters import LENS, NAMES, TIMINGS, prior_sigma, vector_of
from odom.calibration.prior_width import narrowed
from odom.calibration.result import as_measured, calibrated
from odom.calibration.tuning import TUNING

SLOW = slice(TIMINGS, None)
SLOW_FREE = FREE[FREE >= TIMINGS]
POOR = {"fx": 20.0, "fy": -15.0, "cx": 10.0, "cy": -12.0, "k1": 0.12, "shift_u_px": -3.0}


def widths(found) -> dict[str, float]:
    """The widths of the prior as shares of what they are for any camera, up to a factor common to all."""
    share = found.prior.sigma / prior_sigma(SHEET)
    return dict(zip(np.array(NAMES)[found.fitted.free], share[found.fitted.free], strict=True))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_good_calibration_hardly_moves(seed):
    found = as_measured(calibrated(made_up_survey(vector_of(SHEET), seed=seed, points=150), SHEET))
    moved = np.abs(found.vector - found.start)[LENS]
    assert (moved / found.sigma[LENS]).max() < 1.0
    assert (moved / prior_sigma(SHEET)[LENS]).max() < 0.05
    assert max(width for name, width in widths(found).items() if name in NAMES[SLOW]) < 0.1


def test_a_poor_one_is_found_and_its_prior_left_wide_where_it_is_off():
    truth = spoilt(**POOR)
    found = calibrated(made_up_survey(truth, points=250), SHEET)
    width = widths(found)
    assert min(width[name] for name in ("fx", "cx", "k1", "shift_u_px")) > 8.0 * width["p1"]
    assert (np.abs(found.vector - truth)[LENS] < 3.0 * found.sigma[LENS]).all()


def test_a_centre_that_is_off_alone_is_not_bent_away():
    """A centre and tangential distortion look nearly alike to a lens that is bent but little."""
    truth = spoilt(cx=15.0, cy=-15.0)
    found = calibrated(made_up_survey(truth, points=250), SHEET)
    np.testing.assert_allclose(found.vector[5:7], truth[5:7], atol=0.5)
    assert found.sigma[5:7].max() < 0.5


def drawn_walks(width, seed):
    """What four walks say of cameras whose numbers were drawn at `width` times the prior's: errors in sigmas."""
    prior = Prior(vector_of(SHEET), prior_sigma(SHEET))
    rng = np.random.default_rng(seed)
    fitted = fit(System.at_start(made_up_survey(vector_of(SHEET), points=150, seed=seed), SLOW_FREE), prior)
    plain = np.linalg.inv(fitted.information)
    own = prior.sigma[SLOW_FREE]
    off = []
    for _ in range(4):
        truth = prior.mean[SLOW_FREE] + width * own * rng.standard_normal(len(SLOW_FREE))
        seen = np.linalg.inv(fitted.information - np.diag(own**-2.0))
        measured = truth + TUNING.sure_measured * np.linalg.cholesky(seen) @ rng.standard_normal(len(SLOW_FREE))
        pulled = np.linalg.solve(seen, measured - prior.mean[SLOW_FREE])
        vector = prior.mean.copy()
        vector[SLOW_FREE] += plain @ pulled
        narrow = narrowed(prior, replace(fitted, system=replace(fitted.system, vector=vector)), np.sqrt(np.diag(plain)))
        information = np.linalg.inv(seen) + np.diag(narrow.prior.sigma[SLOW_FREE] ** -2.0)
        error = prior.mean[SLOW_FREE] + np.linalg.solve(information, pulled) - truth
        off.append(error / (TUNING.sure_measured * narrow.sigma))
    return np.concatenate(off)


@pytest.mark.parametrize("width", [1.0, 0.25, 0.06, 0.015])
def test_sigmas_hold_however_far_off_cameras_are(width):
    off = np.concatenate([drawn_walks(width, seed) for seed in range(4)])
    assert np.mean(np.abs(off) < 3.0) >= 0.97


def test_another_makes_camera_is_not_held_back_by_what_cameras_usually_are():
    off = np.concatenate([drawn_walks(3.0, seed) for seed in range(4)])
    assert (np.abs(off) < 3.0).all()
    assert np.sqrt(np.mean(off**2)) < 0.97  # 1.01 where widths of the prior and less are all there are


def test_it_is_nearer_to_the_truth_than_what_was_given_in_either_case():
    for numbers in ({"cx": 2.0}, {"fx": 3.0, "k1": 0.01}, POOR):
        truth = spoilt(**numbers)
        found = calibrated(made_up_survey(truth, points=250), SHEET)
        scale = prior_sigma(SHEET)[SLOW]
        before, after = (np.linalg.norm((v - truth)[SLOW] / scale) for v in (found.start, found.vector))
        assert after < before
