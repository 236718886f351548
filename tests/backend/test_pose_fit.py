import numpy as np
import pytest
from made_up_scene import noisy, points_ahead, project

from odom.backend.tracking.pose_information import BEHIND_CAMERA_CHI2, add_up, in_blocks
from odom.backend.tracking.pose_solver import fit_pose, projected, robust_information
from odom.frontend.camera.rolling_shutter import interaction_matrix
from odom.geometry import se3


def sighting(seed, n=200, landmark_sigma=0.0):
    rng = np.random.default_rng(seed)
    T = se3.exp(rng.normal(0.0, 0.15, 6))
    points = points_ahead(rng, n)
    values, variances = noisy(rng, project(T, points))
    roots = landmark_sigma * rng.normal(size=(n, 3, 3))
    covariances = roots @ roots.transpose(0, 2, 1)
    points = points + np.einsum("nij,nj->ni", roots, rng.normal(size=(n, 3)))
    start = se3.exp(rng.normal(0.0, 1.0, 6) * [0.05, 0.05, 0.05, 0.02, 0.02, 0.02]) @ T
    return rng, T, points, covariances, values, variances, start


def error(T_found, T):
    return se3.log(T @ se3.inverse(T_found))


@pytest.mark.parametrize("landmark_sigma", [0.0, 0.004])
def test_the_claimed_covariance_is_honest(landmark_sigma):
    nees = []
    for seed in range(150):
        _, T, points, covariances, values, variances, start = sighting(seed, 150, landmark_sigma)
        fit = fit_pose(points, covariances, values, variances, start)
        e = error(fit.T_camera_map, T)
        nees.append(e @ fit.information @ e)
    assert 4.5 < np.mean(nees) < 7.0  # Cauchy weights give a little away
    assert np.mean(np.array(nees) < 12.59) > 0.93


@pytest.mark.parametrize("seed", range(5))
def test_three_wrong_landmarks_in_ten_do_no_harm(seed):
    rng, T, points, covariances, values, variances, start = sighting(seed)
    clean = fit_pose(points, covariances, values, variances, start)
    values = values.copy()
    values[:60, :2] += rng.uniform(0.02, 0.3, (60, 2)) * rng.choice([-1, 1], (60, 2))
    values[:60, 2] *= rng.uniform(0.5, 2.0, 60)
    fit = fit_pose(points, covariances, values, variances, start, iterations=30)
    e = error(fit.T_camera_map, T)
    assert e @ clean.information @ e < 40.0
    assert (fit.chi2[:60, 0] > 12.0).mean() > 0.95


def test_the_pose_is_found_from_rays_alone():
    for seed in range(10):
        _, T, points, covariances, values, variances, start = sighting(seed)
        values = values.copy()
        values[:, 2] = np.nan
        fit = fit_pose(points, covariances, values, variances, start)
        assert np.linalg.norm(error(fit.T_camera_map, T)) < 0.003
        assert (fit.chi2[:, 1] == 0).all()


def test_a_landmark_behind_the_camera_is_left_out():
    _, T, points, covariances, values, variances, start = sighting(1)
    points = points.copy()
    points[0] = se3.apply(se3.inverse(T), np.array([[0.0, 0.0, -1.0]]))[0]
    fit = fit_pose(points, covariances, values, variances, start)
    assert fit.chi2[0, 0] > 1e6
    assert np.linalg.norm(error(fit.T_camera_map, T)) < 0.003


def test_without_landmarks_the_start_stays():
    start = se3.exp(np.full(6, 0.1))
    fit = fit_pose(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 4)), start)
    np.testing.assert_allclose(fit.T_camera_map, start, atol=1e-12)


@pytest.mark.parametrize("n", [0, 1, 64, 200])
def test_sums_over_blocks_are_to_the_bit_those_of_landmarks_one_by_one(n):
    rng = np.random.default_rng(n)
    points = rng.uniform((-1.0, -1.0, -0.5), (1.0, 1.0, 3.0), (n, 3))
    covariances = np.full((n, 3, 3), 1e-5) + 1e-4 * np.eye(3)
    values, variances = rng.normal(0.3, 0.2, (n, 3)), np.tile([1e-5, 1e-7, 1e-5, 1e-4], (n, 1))
    values[::3, 2] = np.nan
    used, T = rng.random(n) < 0.8, se3.exp(np.full(6, 0.1))
    H, g, chi2, J = np.zeros((6, 6)), np.zeros(6), np.zeros((n, 2)), np.zeros((3, 6))
    for k in np.flatnonzero(used):
        x, y, w = seen = projected(T, points, k)
        if w == 0.0:
            chi2[k, 0] = BEHIND_CAMERA_CHI2
            continue
        *chi2[k], xx, xy, yy, ww = robust_information(T, seen, covariances, values, variances, k, 9.0)
        interaction_matrix(x, y, w, J)
        for a in range(6):
            told = xx * J[0, a] + xy * J[1, a], xy * J[0, a] + yy * J[1, a]
            g[a] += told[0] * (values[k, 0] - x) + told[1] * (values[k, 1] - y)
            H[a] += told[0] * J[0] + told[1] * J[1]
        if ww > 0.0:
            H += np.outer(ww * J[2], J[2])
            g += ww * J[2] * (values[k, 2] - w)
    found = add_up(T, in_blocks(points, covariances, values, variances), used, 9.0)
    np.testing.assert_array_equal(np.triu(found[0]), np.triu(H))
    np.testing.assert_array_equal(found[0], found[0].T)
    np.testing.assert_array_equal(found[1], g)
    np.testing.assert_array_equal(found[2], chi2)
    assert n < 200 or len(set(chi2[:, 0])) > 100
