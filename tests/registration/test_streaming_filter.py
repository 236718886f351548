"""Recursion for real: pairs as they come, asked at any time, instances that add up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from registration_clouds import noisy_pairs

from odom.errors import InputError
from odom.geometry.se3 import apply, exp, inverse, log
from odom.registration import Centroids, Pairs, Prior, RecursiveFilter, kalman, robust


def absorbed(start, pairs, blocks):
    for block in np.array_split(np.arange(len(pairs)), blocks):
        start = start.absorb(pairs[block])
    return start


def same(one, other, tolerance=1e-9):
    np.testing.assert_allclose(one.T_target_source, other.T_target_source, atol=tolerance)
    np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-6, atol=1e-12)


@given(seed=st.integers(0, 10_000), cut=st.integers(5, 95), theta=st.sampled_from([0.0, 0.1, 3.0]))
def test_two_filters_that_saw_different_halves_merge_to_one_that_saw_all(seed, cut, theta):
    T, pairs = noisy_pairs(np.random.default_rng(seed), 100)
    for prior in (Prior(T), Prior(T, 1e-3 * np.eye(6))):
        start = RecursiveFilter(prior, theta=theta)
        one, other = start.absorb(pairs[:cut]), start.absorb(pairs[cut:])
        same(one.merge(other).estimate(), start.absorb(pairs).estimate())
        same(other.merge(one).estimate(), start.absorb(pairs).estimate())


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_one_by_one_in_blocks_and_at_once_are_the_same(rng, alpha):
    T, pairs = noisy_pairs(rng, 100)
    start = RecursiveFilter(Prior(T), alpha=alpha)
    at_once = absorbed(start, pairs, 1).estimate()
    same(absorbed(start, pairs, 7).estimate(), at_once)
    same(absorbed(start, pairs, 100).estimate(), at_once)


def test_the_order_of_the_pairs_does_not_matter(rng):
    T, pairs = noisy_pairs(rng, 100)
    start = RecursiveFilter(Prior(T))
    same(start.absorb(pairs).estimate(), start.absorb(pairs[rng.permutation(100)]).estimate())


def test_the_filter_ends_where_the_estimators_end(rng):
    T, pairs = noisy_pairs(rng, 200)
    found = RecursiveFilter(Prior(T)).absorb(pairs).estimate()
    for estimator in (kalman, robust):
        step = log(inverse(estimator(pairs).T_target_source) @ found.T_target_source)
        assert step @ np.linalg.solve(found.covariance, step) < 0.01


def test_without_any_prior_one_by_one_is_nearly_as_good(rng):
    _, pairs = noisy_pairs(rng, 200)
    found = absorbed(RecursiveFilter(), pairs, 200).estimate()
    step = log(inverse(kalman(pairs).T_target_source) @ found.T_target_source)
    assert step @ np.linalg.solve(found.covariance, step) < 1.0


@pytest.mark.parametrize("blocks", [1, 4, 200, 400])
def test_without_any_prior_the_first_pairs_are_linearised_near_their_own_motion(blocks):
    nees = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        q, T = rng.uniform(-0.5, 0.5, (400, 3)), exp(np.array([0.1, 0.2, -0.3, 0.0, np.pi / 2, 0.0]))
        C = np.tile(np.diag([1e-6, 1e-6, 1e-4]), (400, 1, 1))
        noise = rng.normal(0.0, np.sqrt(np.diag(C[0])), (2, 400, 3))
        result = absorbed(RecursiveFilter(), Pairs(q + noise[0], apply(T, q) + noise[1], C, C), blocks).estimate()
        xi = log(inverse(result.T_target_source) @ T)
        nees.append(xi @ np.linalg.solve(result.covariance, xi))
    assert 4.5 < np.mean(nees) < 8.0


@pytest.mark.parametrize("blocks", [1, 60])
@pytest.mark.parametrize("is_rotation_only", [False, True])
def test_points_on_a_line_are_degenerate_unless_the_prior_is_evidence(blocks, is_rotation_only, rng):
    C, noise = np.full((400, 3), 1e-4), rng.normal(0.0, 0.01, (2, 400, 3))
    line = np.column_stack([rng.uniform(-0.3, 0.3, 400), np.zeros(400), np.full(400, 2.5)])
    pairs, T = Pairs(line + noise[0], line + noise[1], C, C), np.eye(4)
    centroids = Centroids(pairs.points_source.mean(axis=0), pairs.points_target.mean(axis=0))
    start = RecursiveFilter(Prior(T), centroids if is_rotation_only else None)
    result = absorbed(start, pairs, blocks).estimate()
    assert not result.ok
    assert "line" in result.reason
    assert absorbed(RecursiveFilter(Prior(T, 1e-4 * np.eye(6))), pairs, blocks).estimate().ok


def test_it_may_be_asked_at_any_time_and_grows_surer(rng):
    _, pairs = noisy_pairs(rng, 40)
    state, traces = RecursiveFilter(), []
    for k in range(40):
        result = state.estimate()
        assert result.ok or "rotation" in result.reason or "determine" in result.reason
        if k < 3:
            assert not result.ok
        if result.ok:
            traces.append(np.trace(result.covariance))
        state = state.absorb(pairs[k : k + 1])
    assert len(traces) > 30
    assert traces[-1] < 0.3 * traces[0]


def test_theta_is_halved_until_the_filter_exists_and_reported(rng):
    T, pairs = noisy_pairs(rng, 50)
    result = RecursiveFilter(Prior(T), theta=1e6).absorb(pairs).estimate()
    assert result.details["halvings"] > 0
    assert result.details["theta"] == 1e6 / 2 ** result.details["halvings"]
    assert result.details["gamma"] == 1.0 / result.details["theta"]
    Y = RecursiveFilter(Prior(T)).absorb(pairs).information
    assert 50 * result.details["theta"] ** 2 < 0.5 * np.linalg.eigvalsh(Y)[0]


def test_theta_makes_the_covariance_larger_never_smaller(rng):
    T, pairs = noisy_pairs(rng, 50)
    without = RecursiveFilter(Prior(T), theta=0.0).absorb(pairs).estimate()
    with_ = RecursiveFilter(Prior(T), theta=1e6).absorb(pairs).estimate()
    np.testing.assert_allclose(without.T_target_source, with_.T_target_source, atol=1e-2)
    assert np.linalg.eigvalsh(with_.covariance - without.covariance)[0] > 0.0


def test_the_norm_bounded_form_is_more_cautious(rng):
    T, pairs = noisy_pairs(rng, 100)
    exact = RecursiveFilter(Prior(T)).absorb(pairs).estimate()
    bounded = RecursiveFilter(Prior(T), alpha=1.0).absorb(pairs).estimate()
    assert np.trace(bounded.covariance) > np.trace(exact.covariance)
    assert bounded.details["alpha"] == 1.0


def test_the_papers_nine_states_find_the_rotation_about_known_centroids():
    nees = []
    for seed in range(60):
        T, pairs = noisy_pairs(np.random.default_rng(seed), 100, angle=0.3)
        start = RecursiveFilter(Prior(T), Centroids(pairs.points_source.mean(axis=0), pairs.points_target.mean(axis=0)))
        state = absorbed(start, pairs, 3)
        assert state.states.shape == (9,)
        assert state.information.shape == (9, 9)
        result = state.estimate()
        xi = log(inverse(result.T_target_source) @ T)
        assert np.abs(xi).max() < 0.05
        nees.append(xi @ np.linalg.solve(result.covariance, xi))
    assert 4.5 < np.mean(nees) < 8.0


def test_filters_that_do_not_share_their_start_are_not_merged(rng):
    T, _ = noisy_pairs(rng, 3)
    one = RecursiveFilter(Prior(T))
    for other in (
        RecursiveFilter(),
        RecursiveFilter(Prior(T @ exp(np.full(6, 0.1)))),
        RecursiveFilter(Prior(T), theta=1.0),
    ):
        with pytest.raises(InputError, match="cannot be merged"):
            one.merge(other)
    assert one.merge(RecursiveFilter(Prior(T.copy()))).count == 0


@pytest.mark.parametrize("settings", [{"theta": -1.0}, {"alpha": -1.0}, {"theta": np.nan}])
def test_settings_that_make_no_filter_are_refused(settings):
    with pytest.raises(InputError, match="theta"):
        RecursiveFilter(**settings)


def test_the_rotation_only_filter_refuses_a_covariance_of_the_prior_that_it_could_not_use(rng):
    T, pairs = noisy_pairs(rng, 20)
    centroids = Centroids(pairs.points_source.mean(axis=0), pairs.points_target.mean(axis=0))
    assert RecursiveFilter(Prior(T), centroids).absorb(pairs).estimate().ok
    with pytest.raises(InputError, match="centroids"):
        RecursiveFilter(Prior(T, 1e-4 * np.eye(6)), centroids)


def test_the_noise_of_pairs_of_weight_zero_is_not_that_of_the_centroids(rng):
    T, pairs = noisy_pairs(rng, 100, angle=0.2)
    weights = np.ones(100)
    weights[50:] = 0.0
    alone = pairs[:50]
    C_source, C_target = pairs.covariances_source.copy(), pairs.covariances_target.copy()
    C_source[50:], C_target[50:] = 10.0 * np.eye(3), 10.0 * np.eye(3)
    weighted = Pairs(pairs.points_source, pairs.points_target, C_source, C_target, weights)
    start = RecursiveFilter(Prior(T), Centroids(alone.points_source.mean(axis=0), alone.points_target.mean(axis=0)))
    same(start.absorb(weighted).estimate(), start.absorb(alone).estimate())


@pytest.mark.parametrize("n", [1, 3])
def test_a_covariance_of_the_source_that_is_none_is_refused_however_few_the_pairs(n, rng):
    _, pairs = noisy_pairs(rng, n)
    wrong = np.tile(np.diag([1e-4, 1e-4, -1e-2]), (n, 1, 1))
    with pytest.raises(InputError, match="positive definite"):
        RecursiveFilter().absorb(Pairs(pairs.points_source, pairs.points_target, wrong, pairs.covariances_target))
