from dataclasses import replace

import numpy as np
import pytest

from odom.frontend.camera.noise_monitor import FeatureNoise, NoiseMonitor
from odom.frontend.camera.tuning import TUNING

KNOTS = np.array([0.15, 0.3, 0.5, 0.8, 1.2, 2.0])
START = FeatureNoise(0.6, np.stack([KNOTS, np.full(6, 2.1e-3)]))


@pytest.mark.parametrize("pixel", [0.15, 0.5, 2.0])
@pytest.mark.parametrize("depth", [0.001, 0.004])
def test_the_noise_converges_to_the_residuals_own(pixel, depth):
    rng, monitor = np.random.default_rng(0), NoiseMonitor.of(START)
    true = depth * (0.5 + KNOTS)
    for _ in range(400):
        w = rng.uniform(0.15, 2.0, 300)
        ray = rng.normal(0.0, pixel, (300, 2))
        off = rng.normal(0.0, np.interp(w, KNOTS, true))
        claimed = np.interp(w, *monitor.feature_noise.inverse_depth_sigma)
        chi2 = np.column_stack([(ray**2).sum(axis=1) / monitor.feature_noise.pixel_sigma**2, (off / claimed) ** 2])
        monitor = monitor.with_residuals(chi2, w)
    assert monitor.feature_noise.pixel_sigma == pytest.approx(pixel, rel=0.06)
    np.testing.assert_allclose(monitor.feature_noise.inverse_depth_sigma[1], true, rtol=0.15)


def test_a_few_wrong_landmarks_do_not_move_it():
    rng, monitor = np.random.default_rng(0), NoiseMonitor.of(START)
    for _ in range(300):
        chi2 = np.column_stack(
            [rng.chisquare(2, 200) * (0.6 / monitor.feature_noise.pixel_sigma) ** 2, rng.chisquare(1, 200)]
        )
        chi2[:20] = 1e5
        monitor = monitor.with_residuals(chi2, rng.uniform(0.2, 1.5, 200))
    assert monitor.feature_noise.pixel_sigma == pytest.approx(0.6, rel=0.12)


def test_it_never_leaves_its_range_and_too_few_residuals_change_nothing():
    monitor = NoiseMonitor.of(START)
    for _ in range(500):
        monitor = monitor.with_residuals(np.full((50, 2), 1e9), np.full(50, 0.5))
    assert monitor.feature_noise.pixel_sigma <= 8 * 0.6
    for _ in range(1000):
        monitor = monitor.with_residuals(np.full((50, 2), 1e-9), np.full(50, 0.5))
    assert monitor.feature_noise.pixel_sigma >= 0.6 / 8
    assert monitor.with_residuals(np.ones((5, 2)), np.ones(5)) is monitor


@pytest.mark.parametrize("factor", [0.5, 1.0, 4.0])
def test_the_inflation_follows_how_much_the_halves_disagree(factor):
    rng, monitor = np.random.default_rng(1), NoiseMonitor.of(START)
    for _ in range(300):
        monitor = monitor.with_halves(factor * rng.chisquare(6))
    assert monitor.inflation_by_halves == pytest.approx(factor, rel=0.35)
    assert monitor.covariance_scale >= 1.0


def test_the_calibration_errs_by_the_root_of_how_far_the_halves_disagree_beyond_noise():
    monitor, explained = NoiseMonitor.of(START), TUNING.noise_explained
    once, twice = (replace(monitor, inflation_by_halves=explained + more).calibration_error for more in (1.0, 4.0))
    assert replace(monitor, inflation_by_halves=explained).calibration_error == 0.0
    assert once == pytest.approx(TUNING.noise_calibration_error)
    assert twice == pytest.approx(2.0 * once)
