"""The fields of a registration beside its pose say what their docstring promises, or that they are not known."""

from dataclasses import replace

import numpy as np
import pytest
from registration_clouds import noisy_pairs

from odom.geometry.se3 import apply, exp
from odom.registration import Centroids, Pairs, Prior, RecursiveFilter, horn, kalman, register, robust, wicp

VAGUE = Prior(np.eye(4), 1e-2 * np.eye(6))


@pytest.mark.parametrize("estimator", [register, kalman, robust])
@pytest.mark.parametrize("prior", [None, Prior(np.eye(4))])
def test_squared_residuals_that_were_never_computed_are_nan(estimator, prior, rng):
    """Memory that nobody filled would look like residuals."""
    _, pairs = noisy_pairs(rng, 2000)
    for fill in (7.0, 3.0):
        dirty = [np.full(2000, fill) for _ in range(20)]  # what the next arrays are likely to find there
        del dirty
        result = estimator(replace(pairs, weights=np.zeros(2000)), prior)
        assert not result.ok
        if prior is None or estimator is not register:
            assert np.isnan(result.chi2).all()


@pytest.mark.parametrize("estimator", [kalman, robust])
def test_points_that_determine_nothing_have_no_conditioning_whatever_a_prior_adds(estimator, rng):
    _, pairs = noisy_pairs(rng, 20)
    place = Pairs(np.ones((20, 3)), np.ones((20, 3)), None, np.full((20, 3), 1e-4))
    for nothing in (replace(pairs, weights=np.zeros(20)), place):
        result = estimator(nothing, VAGUE)
        assert result.ok
        assert result.conditioning == 0.0


@pytest.mark.filterwarnings("error")
def test_a_streaming_filter_that_has_seen_its_prior_alone_has_no_conditioning():
    result = RecursiveFilter(VAGUE).estimate()
    assert result.ok
    assert result.conditioning == 0.0


@pytest.mark.parametrize("prior", [None, VAGUE])
def test_the_streaming_filters_conditioning_is_that_of_the_estimators(prior, rng):
    q = rng.uniform(-1.0, 1.0, (200, 3)) * [1.0, 0.3, 0.2] + [0.0, 0.0, 5.0]
    pairs = Pairs(q, apply(exp(np.full(6, 0.05)), q), None, np.full((200, 3), 1e-4))
    expected = kalman(pairs, prior).conditioning
    found = RecursiveFilter(prior, theta=0.0).absorb(pairs).estimate().conditioning
    assert found == pytest.approx(expected, rel=1e-6)
    assert expected > 10.0 * np.linalg.cond(kalman(pairs, prior).covariance) ** -1.0


def test_the_rotation_only_filters_conditioning_is_scaled_by_the_points_too(rng):
    q = rng.uniform(-1.0, 1.0, (200, 3)) * [1.0, 0.3, 0.2]
    pairs = Pairs(q, apply(exp(np.full(6, 0.05)), q), None, np.full((200, 3), 1e-4))
    centroids = Centroids(q.mean(axis=0), pairs.points_target.mean(axis=0))
    found = RecursiveFilter(centroids=centroids, theta=0.0).absorb(pairs).estimate().conditioning
    assert found == pytest.approx(kalman(pairs).conditioning, rel=1e-3)


@pytest.mark.parametrize("contradicted", [False, True])
def test_a_norm_bound_is_named_only_where_it_was_used(contradicted, rng):
    _, pairs = noisy_pairs(rng, 200)
    spread = np.where(np.arange(200)[:, None] % 2, 0.05, 0.0) if contradicted else 0.0
    wrong = replace(pairs, points_target=pairs.points_target + spread * rng.normal(size=(200, 3)))
    bounded, exact = robust(wrong, alpha=1.0), robust(wrong)
    assert bounded.details["alpha"] == (0.0 if contradicted else 1.0)
    assert exact.details["alpha"] == 0.0
    same = np.allclose(bounded.covariance, exact.covariance, rtol=0.05)
    assert same == contradicted


def test_the_variance_factor_is_a_variance_where_no_noise_was_stated_and_unknown_where_pairs_are_not_kept(rng):
    q = rng.uniform(-1.0, 1.0, (500, 3))
    bare = Pairs(q, q + rng.normal(0.0, 0.02, (500, 3)))
    stated = replace(bare, covariances_target=np.full((500, 3), 0.01**2))
    assert horn(bare).variance_factor == pytest.approx(0.02**2, rel=0.1)
    assert wicp(bare).variance_factor == pytest.approx(0.02**2, rel=0.1)
    assert wicp(stated).variance_factor == pytest.approx(4.0, rel=0.1)
    assert kalman(stated).variance_factor == pytest.approx(4.0, rel=0.1)
    assert np.isnan(RecursiveFilter().absorb(stated).estimate().variance_factor)
