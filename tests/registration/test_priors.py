"""A prior with covariance is fused as what it is: a measurement of log(inv(T0) T), near or far, of any shape."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import least_squares

from odom.geometry import compiled_se3
from odom.geometry.se3 import apply, exp, inverse, log
from odom.registration import Pairs, Prior, RecursiveFilter, kalman, robust

tangents = arrays(np.float64, 6, elements=st.floats(-1.5, 1.5, allow_nan=False))
NOISE_M = 0.05


def vague(seed, sigma):
    """Return the true motion, 8 pairs and a prior, all drawn as their covariances say."""
    rng = np.random.default_rng(seed)
    T, q = exp(rng.normal(0.0, 0.2, 6)), rng.uniform(-0.2, 0.2, (8, 3)) + np.array([0.0, 0.0, 1.5])
    root = rng.normal(size=(6, 6))
    P = sigma**2 * (root @ root.T / 6.0 + 1e-4 * np.eye(6))
    prior = Prior(T @ exp(-np.linalg.cholesky(P) @ rng.normal(size=6)), P)
    return T, Pairs(q, apply(T, q) + rng.normal(0.0, NOISE_M, (8, 3)), None, np.full((8, 3), NOISE_M**2)), prior


def most_likely(T, pairs, prior):
    """Return the motion of greatest posterior density, found from `T`, and its information."""
    L = np.linalg.cholesky(np.linalg.inv(prior.covariance)).T

    def residuals(xi):
        moved = T @ exp(xi)
        of_pairs = (pairs.points_target - apply(moved, pairs.points_source)).ravel() / NOISE_M
        return np.concatenate([of_pairs, L @ log(inverse(prior.T_target_source) @ moved)])

    found = least_squares(residuals, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    again = T @ exp(found.x)
    J = least_squares(lambda xi: residuals(log(inverse(T) @ again @ exp(xi))), np.zeros(6), max_nfev=1).jac
    return again, J.T @ J


def filtered(pairs, prior):
    return RecursiveFilter(prior, theta=0.0).absorb(pairs).estimate()


@pytest.mark.parametrize("estimator", [kalman, filtered])
@pytest.mark.parametrize("sigma", [0.1, 0.3])
def test_a_prior_of_any_shape_and_far_from_the_pairs_gives_the_most_likely_motion(estimator, sigma):
    for seed in range(20):
        T, pairs, prior = vague(seed, sigma)
        best, information = most_likely(T, pairs, prior)
        result = estimator(pairs, prior)
        off = log(inverse(best) @ result.T_target_source)
        assert off @ information @ off < 1e-6
        np.testing.assert_allclose(np.linalg.inv(result.covariance), information, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("estimator", [kalman, robust])
@pytest.mark.parametrize("n", [1, 2])
def test_a_prior_makes_up_for_pairs_that_are_too_few(estimator, n):
    T, pairs, prior = vague(0, 0.1)
    best, information = most_likely(T, pairs[:n], prior)
    result = estimator(pairs[:n], prior)
    assert result.ok
    off = log(inverse(best) @ result.T_target_source)
    assert off @ information @ off < 1e-6
    assert not estimator(pairs[:n], Prior(prior.T_target_source)).ok
    assert not estimator(pairs[:0], prior).ok


@pytest.mark.parametrize("sigma", [1e-3, 0.1, 0.3])
def test_the_variance_factor_of_few_pairs_with_a_prior_is_one_where_the_noise_is_true(sigma):
    factors = []
    for seed in range(300):
        _, pairs, prior = vague(seed, sigma)
        factors.append(kalman(pairs[:4], prior).variance_factor)
    assert np.mean(factors) == pytest.approx(1.0, abs=0.1)


def correlated(seed):
    """Return the true motion, 4 accurate pairs and a prior of correlated errors of .1 m and .2 rad."""
    rng = np.random.default_rng(seed)
    T, q, sigma = exp(rng.normal(size=6)), rng.uniform(-1.0, 1.0, (4, 3)), np.array([0.002, 0.002, 0.01])
    root = rng.normal(size=(6, 6))
    root *= np.array([0.1, 0.1, 0.1, 0.2, 0.2, 0.2])[:, None] / np.linalg.norm(root, axis=1, keepdims=True)
    prior = Prior(T @ exp(-root @ rng.normal(size=6)), root @ root.T)
    noise, C = sigma * rng.normal(size=(2, 4, 3)), np.tile(np.diag(sigma**2), (4, 1, 1))
    return T, Pairs(q + noise[0], apply(T, q) + noise[1], C, C), prior


@pytest.mark.parametrize("estimator", [kalman, robust])
def test_a_prior_of_correlated_errors_does_not_make_few_pairs_look_better_than_they_are(estimator):
    """Its share of the six numbers of a motion is at most six, however far it is off."""
    nees, factors = [], []
    for seed in range(400):
        T, pairs, prior = correlated(seed)
        result = estimator(pairs, prior)
        xi = log(inverse(result.T_target_source) @ T)
        nees.append(xi @ np.linalg.solve(result.covariance, xi))
        factors.append(result.variance_factor)
    assert np.mean(nees) == pytest.approx(6.0, abs=1.0)
    assert np.mean(factors) == pytest.approx(1.0, abs=0.1)


def test_the_covariance_after_fusing_a_vague_prior_is_true():
    nees = []
    for seed in range(200):
        T, pairs, prior = vague(seed, 0.3)
        result = kalman(pairs, prior)
        xi = log(inverse(result.T_target_source) @ T)
        nees.append(xi @ np.linalg.solve(result.covariance, xi))
    assert 4.5 < np.mean(nees) < 8.0


@given(tangents, st.sampled_from([1.0, 1e-3, 1e-6, 0.0]))
def test_the_inverse_right_jacobian_is_the_slope_of_the_logarithm(xi, size):
    xi = size * xi
    J, step = np.empty((6, 6)), 1e-6
    compiled_se3.inverse_right_jacobian(xi, J)
    slopes = [(log(exp(xi) @ exp(step * e)) - log(exp(xi) @ exp(-step * e))) / (2.0 * step) for e in np.eye(6)]
    np.testing.assert_allclose(J, np.transpose(slopes), atol=1e-7)


@pytest.mark.parametrize("times_stated", [0.5, 2.0])
def test_noise_that_is_not_as_stated_is_none_of_the_priors(times_stated):
    nees, sigma = [], np.array([0.005] * 6)
    for seed in range(100):
        rng = np.random.default_rng(seed)
        q, T = rng.uniform(-0.5, 0.5, (200, 3)) + np.array([0.0, 0.0, 2.0]), exp(rng.normal(0.0, 0.2, 6))
        C, noise = np.full((200, 3), 1e-4), times_stated * rng.normal(0.0, 0.01, (2, 200, 3))
        prior = Prior(T @ exp(sigma * rng.normal(size=6)), np.diag(sigma**2))
        result = robust(Pairs(q + noise[0], apply(T, q) + noise[1], C, C), prior)
        off = log(inverse(result.T_target_source) @ T)
        nees.append(off @ np.linalg.solve(result.covariance, off))
    assert np.mean(nees) == pytest.approx(6.0, abs=0.9)
