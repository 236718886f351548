"""The model of an odometry's errors: what it leaves of drift is white, and it is of no frame in particular."""

import numpy as np
import pytest
from synthetic import smooth, trajectory

from odom.evaluation.drift import Whitener
from odom.geometry import se3


@pytest.fixture(scope="module")
def drift():
    """Poses, and errors that keep nine tenths of the one before while what is new pivots about a point ahead."""
    rng = np.random.default_rng(0)
    T = trajectory(smooth(rng, seconds=200.0), np.arange(0.0, 200.0, 1 / 6)).T_world_body
    pivot = se3.adjoint(se3.exp(np.array([0.0, 0.0, 1.5, 0.0, 0.0, 0.0])))
    errors = [np.zeros(6)]
    for motion in se3.inverses(T[1:]) @ T[:-1]:
        new = pivot @ rng.normal(0, [2e-4] * 3 + [1e-3] * 3)
        errors.append(0.9 * se3.adjoint(motion) @ errors[-1] + new)
    return T, np.array(errors)


def test_what_is_left_of_drift_is_white_and_of_unit_variance(drift):
    T, errors = drift
    white = Whitener.fit(errors, T)(errors[:, :, None])[:, :, 0]
    np.testing.assert_allclose(white.T @ white / len(white), np.eye(6), atol=0.05)
    np.testing.assert_allclose(white[1:].T @ white[:-1] / len(white), np.zeros((6, 6)), atol=0.12)


def test_errors_weigh_the_same_whichever_frame_on_the_camera_they_are_given_in(drift):
    T, errors = drift
    T_camera_other = se3.exp(np.array([0.3, -0.2, 0.5, 0.4, 1.0, -0.7]))
    moved = errors @ se3.adjoint(se3.inverse(T_camera_other)).T
    here = Whitener.fit(errors, T)(errors[:, :, None])
    there = Whitener.fit(moved, T @ T_camera_other)(moved[:, :, None])
    np.testing.assert_allclose(np.square(there).sum(axis=1), np.square(here).sum(axis=1), rtol=0.01)
