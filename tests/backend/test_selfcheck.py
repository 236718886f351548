import numpy as np
import pytest

from odom.backend.selfcheck import SelfCheck
from odom.frontend.measure import FeatureNoise

KNOTS = np.array([0.15, 0.3, 0.5, 0.8, 1.2, 2.0])
START = FeatureNoise(0.6, np.stack([KNOTS, np.full(6, 2.1e-3)]))


@pytest.mark.parametrize("pixel", [0.15, 0.5, 2.0])
@pytest.mark.parametrize("depth", [0.001, 0.004])
def test_the_noise_converges_to_the_residuals_own(pixel, depth):
    rng, check = np.random.default_rng(0), SelfCheck.of(START)
    true = depth * (0.5 + KNOTS)
    for _ in range(400):
        w = rng.uniform(0.15, 2.0, 300)
        ray = rng.normal(0.0, pixel, (300, 2))
        off = rng.normal(0.0, np.interp(w, KNOTS, true))
        claimed = np.interp(w, *check.noise.inverse_depth_sigma)
        chi2 = np.column_stack([(ray**2).sum(axis=1) / check.noise.pixel_sigma**2, (off / claimed) ** 2])
        check = check.with_residuals(chi2, w)
    assert check.noise.pixel_sigma == pytest.approx(pixel, rel=0.06)
    np.testing.assert_allclose(check.noise.inverse_depth_sigma[1], true, rtol=0.15)


def test_a_few_wrong_landmarks_do_not_move_it():
    rng, check = np.random.default_rng(0), SelfCheck.of(START)
    for _ in range(300):
        chi2 = np.column_stack([rng.chisquare(2, 200) * (0.6 / check.noise.pixel_sigma) ** 2, rng.chisquare(1, 200)])
        chi2[:20] = 1e5
        check = check.with_residuals(chi2, rng.uniform(0.2, 1.5, 200))
    assert check.noise.pixel_sigma == pytest.approx(0.6, rel=0.12)


def test_it_never_leaves_its_range_and_too_few_residuals_change_nothing():
    check = SelfCheck.of(START)
    for _ in range(2000):
        check = check.with_residuals(np.full((50, 2), 1e9), np.full(50, 0.5))
    assert check.noise.pixel_sigma <= 8 * 0.6
    for _ in range(4000):
        check = check.with_residuals(np.full((50, 2), 1e-9), np.full(50, 0.5))
    assert check.noise.pixel_sigma >= 0.6 / 8
    assert check.with_residuals(np.ones((5, 2)), np.ones(5)) is check


@pytest.mark.parametrize("factor", [0.5, 1.0, 4.0])
def test_the_inflation_follows_how_much_the_halves_disagree(factor):
    rng, check = np.random.default_rng(1), SelfCheck.of(START)
    for _ in range(300):
        check = check.with_disagreement(factor * rng.chisquare(6))
    assert check.inflation == pytest.approx(factor, rel=0.35)
    assert check.scale >= 1.0
