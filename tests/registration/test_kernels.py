"""The compiled loops against the plain formulas of `se3` and numpy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from registration_clouds import noisy_pairs, random_covariances

from odom.geometry import compiled_se3, se3
from odom.registration import linear_algebra, measurement_covariance, pair_information

tangents = arrays(np.float64, 6, elements=st.floats(-1.5, 1.5, allow_nan=False))


@given(tangents, tangents)
def test_composing_a_tangent_is_multiplying_by_its_exponential(a, b):
    T = se3.exp(a)
    expected = T @ se3.exp(b)
    compiled_se3.compose_tangent(T, b)
    np.testing.assert_allclose(T, expected, atol=1e-9)


@given(tangents, tangents)
def test_relative_tangent_is_the_logarithm_of_the_motion_between_two(a, b):
    xi = np.empty(6)
    compiled_se3.relative_tangent(se3.exp(a) @ se3.exp(b), se3.exp(a), xi)
    np.testing.assert_allclose(xi, se3.log(se3.exp(b)), atol=1e-9)


def test_precisions_invert_the_sum_of_both_covariances(rng):
    Sq, Sp, R = random_covariances(rng, 50), random_covariances(rng, 50), se3.so3_exp(rng.normal(size=3))
    W = np.empty((50, 8))
    assert measurement_covariance.precisions(Sq, Sp, R, 0.0, W) == -1
    S = Sp + R @ Sq @ R.T
    np.testing.assert_allclose(
        W[:, (0, 1, 2, 1, 3, 4, 2, 4, 5)].reshape(-1, 3, 3) @ S, np.tile(np.eye(3), (50, 1, 1)), atol=1e-8
    )
    np.testing.assert_allclose(W[:, 7], 0.5 * np.log(np.linalg.det(S)))


@pytest.mark.parametrize(
    "bad", [np.zeros((3, 3)), np.diag([1.0, 1.0, -1.0]), np.full((3, 3), np.nan), np.diag([1, 1, 0])]
)
def test_precisions_name_the_covariance_that_is_not_positive(rng, bad):
    Sp = random_covariances(rng, 5)
    Sp[3] = bad
    assert measurement_covariance.precisions(np.empty((0, 3, 3)), Sp, np.eye(3), 0.0, np.empty((5, 8))) == 3


def test_information_is_the_sum_of_the_pairs(rng):
    _, pairs = noisy_pairs(rng, 20, both=False)
    W, A, y = np.empty((20, 8)), np.zeros((6, 10)), np.zeros(12)
    measurement_covariance.precisions(np.empty((0, 3, 3)), pairs.covariances_target, np.eye(3), 0.0, W)
    pair_information.accumulate(pairs.points_source, pairs.points_target, W, np.ones(20), A, y)
    Y = np.empty((12, 12))
    pair_information.information_matrix(A, Y)
    expected, right = np.zeros((12, 12)), np.zeros(12)
    for q, p, C in zip(pairs.points_source, pairs.points_target, pairs.covariances_target, strict=True):
        H = np.kron(np.eye(3), np.append(q, 1.0))
        expected += H.T @ np.linalg.inv(C) @ H
        right += H.T @ np.linalg.inv(C) @ p
    np.testing.assert_allclose(Y, expected, rtol=1e-8)
    np.testing.assert_allclose(y, right, rtol=1e-8)


def test_what_is_added_for_the_sources_noise_is_its_share_of_the_information_times_the_motion(rng):
    Sq, Sp, weights = random_covariances(rng, 20), random_covariances(rng, 20), rng.uniform(-0.5, 1.0, 20)
    T, W, y = se3.exp(rng.normal(size=6)), np.empty((20, 8)), np.zeros(12)
    measurement_covariance.precisions(Sq, Sp, T, 0.0, W)
    pair_information.allow_for_source_noise(Sq, T, W, weights, y)
    noise = np.zeros((12, 12))
    for weight, Q, P in zip(np.maximum(weights, 0.0), Sq, Sp, strict=True):
        padded = np.zeros((4, 4))
        padded[:3, :3] = Q
        noise += weight * np.kron(np.linalg.inv(P + T[:3, :3] @ Q @ T[:3, :3].T), padded)
    np.testing.assert_allclose(y, noise @ T[:3].ravel(), rtol=1e-8, atol=1e-12)


def test_eigenvalues_agree_with_numpy(rng):
    S = rng.normal(size=(6, 6))
    S = S @ S.T
    D, V = S.copy(), np.eye(6)
    linear_algebra.jacobi(D, V)
    np.testing.assert_allclose(np.sort(np.diag(D)), np.linalg.eigvalsh(S), atol=1e-10)
    np.testing.assert_allclose(V @ np.diag(np.diag(D)) @ V.T, S, atol=1e-10)
