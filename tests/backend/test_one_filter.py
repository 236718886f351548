"""The pose of a frame against landmarks and the paper's recursion are one filter: the same pose, the same information.

A landmark q with noise Sq is a source point, its image (x/z, y/z, 1/z) with noise Sp the target. At a pose, the
measurement is one of the twelve states x = vec[R | t], C = P (I3 (x) [q' 1]) with P the projection's derivative, and
S = Sp + P R Sq R' P'. A feature without depth has two rows instead of three.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_scene import noisy, points_ahead, project

from odom.backend.tracking.pose_solver import _PRIOR, fit_pose
from odom.geometry import se3
from odom.registration.pair_information import accumulate, information_matrix
from odom.registration.weighted_projection import project_onto_se3

NO_WEIGHTS = np.inf
"""Where a Cauchy weight would be one half."""


def scene(seed, n, blind_share):
    """Landmarks with covariances, what a camera measures of them, with variances, and its pose."""
    rng = np.random.default_rng(seed)
    T, points = se3.exp(rng.normal(0.0, 0.15, 6)), points_ahead(rng, n)
    values, variances = noisy(rng, project(T, points))
    variances *= rng.uniform(0.3, 3.0, (n, 1))
    variances[:, 1] = rng.uniform(-0.5, 0.5, n) * np.sqrt(variances[:, 0] * variances[:, 2])
    roots = rng.normal(0.0, 0.003, (n, 3, 3))
    values[rng.random(n) < blind_share, 2] = np.nan
    return points, roots @ roots.transpose(0, 2, 1), values, variances, T


def as_pairs(points, covariances, values, variances, T):
    """Each measurement as a target point and its precision, linearised at `T`: what the recursion takes in."""
    X, R = se3.apply(T, points), T[:3, :3]
    targets, W = X.copy(), np.zeros((len(points), 8))
    for k, (x, y, z) in enumerate(X):
        P = np.array([[1.0, 0.0, -x / z], [0.0, 1.0, -y / z], [0.0, 0.0, -1.0 / z]]) / z
        xx, xy, yy, ww = variances[k]
        carried = P @ R @ covariances[k] @ R.T @ P.T
        precision = np.zeros((3, 3))
        precision[:2, :2] = np.linalg.inv(np.array([[xx, xy], [xy, yy]]) + carried[:2, :2])
        residual = np.array([values[k, 0] - x / z, values[k, 1] - y / z, 0.0])
        if values[k, 2] > 0.0:
            precision[2, 2] = 1.0 / (ww + carried[2, 2])
            residual[2] = values[k, 2] - 1.0 / z
        targets[k] += np.linalg.solve(P, residual)
        W[k, :6] = (P.T @ precision @ P)[np.triu_indices(3)]
    return targets, W


def recursion(points, covariances, values, variances, T):
    """The recursion of `odom.registration`, linearised anew until it stays; its pose and information."""
    H = np.empty((6, 6))
    for _ in range(12):
        targets, W = as_pairs(points, covariances, values, variances, T)
        A, Y, y = np.zeros((6, 10)), np.empty((12, 12)), np.zeros(12)
        accumulate(points, targets, W, np.ones(len(points)), A, y)
        information_matrix(A, Y)
        before, T = T, T.copy()
        assert project_onto_se3(Y, y, np.empty((0, 0)), T, T, H) > 0
        if np.abs(T - before).max() < 1e-13:
            break
    return T, H


def fitted(points, covariances, values, variances, T):
    """`fit_pose` without robust weights, until it stays; its pose and information (of exp(xi) T)."""
    for _ in range(3):
        fit = fit_pose(points, covariances, values, variances, T, cauchy=NO_WEIGHTS)
        T = fit.T_camera_map
    return T, fit.information - _PRIOR * np.eye(6)


@given(st.integers(0, 100_000), st.integers(12, 200), st.sampled_from([0.0, 0.3, 1.0]))
def test_fit_pose_and_the_recursion_give_the_same_pose_and_information(seed, n, blind_share):
    points, covariances, values, variances, true = scene(seed, n, blind_share)
    T, information = fitted(points, covariances, values, variances, true)
    T_recursive, H = recursion(points, covariances, values, variances, true)
    np.testing.assert_allclose(T_recursive, T, atol=1e-9)
    A = se3.adjoint(se3.inverse(T))  # exp(xi) T = T exp(A xi)
    np.testing.assert_allclose(A.T @ H @ A, information, rtol=0.0, atol=1e-9 * np.abs(information).max())


@pytest.mark.parametrize("weight", ["right", "twice"])
def test_the_comparison_sees_a_covariance_that_is_not_the_same(weight):
    points, covariances, values, variances, true = scene(1, 100, 0.3)
    information = fitted(points, covariances, values, variances, true)[1]
    T, H = recursion(points, covariances * (2.0 if weight == "twice" else 1.0), values, variances, true)
    A = se3.adjoint(se3.inverse(T))
    off = np.abs(A.T @ H @ A - information).max() / np.abs(information).max()
    assert off < 1e-9 if weight == "right" else off > 1e-3
