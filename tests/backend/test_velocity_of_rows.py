import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from odom.backend.tracking.motion_model import ANY_VELOCITY, Motion, ProcessNoise, Velocity
from odom.backend.tracking.pose_solver import fit_pose
from odom.backend.tracking.row_velocity import fit_velocity
from odom.frontend.camera.rolling_shutter import point_flow
from odom.frontend.features.measurement import Measurements
from odom.geometry import se3

READOUT_S, PERIOD_S, SIGMA = 0.027, 1.0 / 30.0, 2e-4
SLOW_HAND = np.array([0.3, 0.3, 0.3, 0.6, 0.6, 0.6])


def seen(seed: int, twist, carried_with, readout_s=READOUT_S, n=250):
    """Return points (map = the camera's frame a period ago), what a moving camera measures of them, row times."""
    rng = np.random.default_rng(seed)
    rays = rng.uniform([-0.55, -0.42], [0.55, 0.42], (n, 2))
    inverse_depth = rng.uniform(0.25, 1.2, n)
    row_s = rays[:, 1] / 0.84 * readout_s
    T_camera_map = se3.exp(-np.asarray(twist) * PERIOD_S)
    at_middle = np.column_stack([rays, np.ones(n)]) / inverse_depth[:, None]
    points = se3.apply(se3.inverse(T_camera_map), at_middle)
    values = np.empty((n, 3))
    for k in range(n):
        X, Y, Z = se3.apply(se3.exp(-np.asarray(twist) * row_s[k]), at_middle[k : k + 1])[0]
        x, y = np.array([X / Z, Y / Z]) + rng.normal(0, SIGMA, 2)
        xd, yd, _ = point_flow(x, y, inverse_depth[k], np.asarray(carried_with))
        values[k] = x - xd * row_s[k], y - yd * row_s[k], inverse_depth[k]
    variances = np.tile([SIGMA**2, 0.0, SIGMA**2, 1e-4**2], (n, 1))
    measured = Measurements(values, np.zeros((n, 3, 3)), variances, np.zeros((n, 2)))
    return points, measured, row_s


def velocity(points, measured, row_s, carried_with):
    covariances = np.tile(1e-10 * np.eye(3), (len(points), 1, 1))
    start = fit_pose(points, covariances, measured.values, measured.covariance, np.eye(4)).T_camera_map
    expected = Motion.of(np.eye(4), np.diag([1e-3**2] * 6)).after(PERIOD_S, ProcessNoise())
    return fit_velocity(points, covariances, measured, row_s, start, np.asarray(carried_with), expected, 1.0)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_the_rows_tell_the_velocity_better_than_two_poses_do(seed, direction):
    twist = SLOW_HAND * direction
    carried_with = twist + 0.2 * SLOW_HAND
    found = velocity(*seen(seed, twist, carried_with), carried_with)
    of_two_poses = np.sqrt(2) * 1e-3 / PERIOD_S
    assert np.abs(found.twist - twist).max() < of_two_poses
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0
    assert np.linalg.norm(found.twist - twist) < 0.5 * np.linalg.norm(carried_with - twist)


def test_its_covariance_allows_for_errors_that_frames_share():
    nees = []
    for seed in range(40):
        twist = SLOW_HAND * np.random.default_rng(seed).uniform(-1, 1, 6)
        found = velocity(*seen(seed, twist, twist), twist)
        nees.append((found.twist - twist) @ np.linalg.solve(found.covariance, found.twist - twist))
    assert 6.0 / 16.0 < np.mean(nees) < 6.0


@pytest.mark.parametrize("since_s", [1e-9, 1e-8, 1e-6, 1e-4, PERIOD_S])
def test_the_first_pose_of_all_may_be_known_for_certain_and_be_no_time_ago(since_s):
    twist = SLOW_HAND * [0.5, -0.3, 0.2, 0.4, -0.6, 0.1]
    points, measured, row_s = seen(2, twist, twist)
    covariances = np.tile(1e-10 * np.eye(3), (len(points), 1, 1))
    T_camera_map = fit_pose(points, covariances, measured.values, measured.covariance, np.eye(4)).T_camera_map
    known = Motion.of(se3.inverse(T_camera_map), np.zeros((6, 6)), Velocity(twist, ANY_VELOCITY.covariance))
    expected = known.after(since_s, ProcessNoise(steady_s=0.0))
    found = fit_velocity(points, covariances, measured, row_s, T_camera_map, twist, expected, 1.0)
    assert np.isfinite(found.twist).all()
    assert np.linalg.eigvalsh(found.covariance)[0] > 0.0
    assert np.linalg.eigvalsh(expected.P[6:, 6:] - found.covariance)[0] > 0.0
    if since_s < 1e-3:
        assert (np.abs(found.twist - twist) < 5.0 * np.sqrt(np.diag(found.covariance))).all()


def test_of_a_global_shutter_the_poses_alone_tell_it():
    twist = np.array([0.1, -0.2, 0.05, 0.3, -0.2, 0.1])
    points, measured, row_s = seen(1, twist, twist, readout_s=0.0)
    still = velocity(points, measured, row_s, np.zeros(6))
    moving = velocity(points, measured, row_s, twist)
    np.testing.assert_allclose(still.twist, moving.twist, atol=1e-9)
    np.testing.assert_allclose(still.twist, twist, atol=5e-3 / PERIOD_S)
