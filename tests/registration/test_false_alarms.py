"""A consensus that chance could give is no motion, whatever else is in the cloud."""

import numpy as np
import pytest

from odom.registration import Pairs, register
from odom.registration.checked_arrays import checked
from odom.registration.false_alarms import chance
from odom.registration.measurement_covariance import precisions

BOUND = 16.27


def hopeless(seed, n=100, sigma=0.05):
    """Pairs that have nothing to do with each other, in a box of two metres."""
    rng = np.random.default_rng(seed)
    variances = np.full((n, 3), sigma**2)
    return Pairs(rng.uniform(-1.0, 1.0, (n, 3)), rng.uniform(-1.0, 1.0, (n, 3)), variances, variances)


def probability(pairs):
    arrays, W = checked(pairs), np.empty((len(pairs), 8))
    assert precisions(arrays.Sq, arrays.Sp, np.eye(3), 0.0, W) == -1
    return chance(arrays.p, W, arrays.weights, BOUND)


@pytest.mark.parametrize("n", [10, 20, 100])
@pytest.mark.parametrize("far_m", [10.0, 100.0, 1e4])
def test_one_far_target_does_not_make_hopeless_pairs_believable(far_m, n):
    believed = 0
    for seed in range(50):
        pairs = hopeless(seed, n)
        pairs.points_target[0] = far_m
        believed += register(pairs).ok
    assert believed == 0


def test_pairs_of_weight_zero_do_not_widen_the_box_of_the_targets():
    pairs = hopeless(0)
    weights = np.ones(100)
    weights[:30] = 0.0
    alone = probability(pairs[weights > 0.0])
    pairs.points_target[:30] = 1e3
    weighted = Pairs(
        pairs.points_source, pairs.points_target, pairs.covariances_source, pairs.covariances_target, weights
    )
    assert probability(weighted) == pytest.approx(alone, rel=1e-12)


@pytest.mark.parametrize("n", [30, 400])
def test_of_targets_spread_evenly_the_box_is_that_of_them_all(n):
    for seed in range(20):
        pairs = hopeless(seed, n)
        p, radius = pairs.points_target, np.sqrt(BOUND * 2.0 * 0.05**2)
        gate = 4.0 / 3.0 * np.pi * radius**3
        whole = gate / np.prod(np.ptp(p, axis=0) + radius)
        assert whole * (1.0 - 1e-5) <= probability(pairs) < 1.5 * whole


@pytest.mark.parametrize("jitter", [0.0, 0.25, 1.0])
@pytest.mark.parametrize(("spots", "times"), [(12, 4), (12, 11), (40, 4)])
def test_hopeless_pairs_are_not_believed_for_being_repeated(spots, times, jitter):
    """Three of them always agree on some motion, with all that repeat them."""
    believed, sigma = 0, 0.02
    for seed in range(50):
        rng = np.random.default_rng(seed)
        spot = np.repeat(np.arange(spots), rng.integers(1, times + 1, spots))
        q, p = (rng.uniform(-1.0, 1.0, (spots, 3))[spot] for _ in range(2))
        q, p = (points + rng.normal(0.0, jitter * sigma, points.shape) for points in (q, p))
        variances = np.full((len(spot), 3), sigma**2)
        believed += register(Pairs(q, p, variances, variances)).ok
    assert believed == 0


@pytest.mark.parametrize("times", [1, 5])
def test_repeated_pairs_of_enough_spots_are_believed_among_as_many_wrong_ones(times):
    variances = np.full((40 * times, 3), 0.01**2)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        q = rng.uniform(-1.0, 1.0, (40, 3))
        p = q + np.array([0.1, 0.02, 0.05])
        p[20:] = rng.uniform(-1.0, 1.0, (20, 3))
        q, p = (np.repeat(points, times, axis=0) for points in (q, p))
        found = register(Pairs(q + rng.normal(0.0, 0.01, q.shape), p, variances, variances))
        assert found.ok
        assert found.inliers[: 20 * times].mean() > 0.95
        np.testing.assert_allclose(found.T_target_source[:3, 3], [0.1, 0.02, 0.05], atol=0.02)
