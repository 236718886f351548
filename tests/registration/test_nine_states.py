"""The recursion in the paper's own form, against figures derived independently of this code."""

import numpy as np
import pytest
from nine_states import FilterState, hinfinity_step, kalman_step, rotation_model

from odom.errors import InputError
from odom.geometry.se3 import so3_exp, so3_log
from odom.registration.paper.streaming_filter import nearest_rotation

R30 = so3_exp(np.array([0.0, 0.0, np.pi / 6]))
SOURCE = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
TARGET = SOURCE @ R30.T + [[0.01, 0, 0], [0, -0.01, 0], [0, 0, 0.01], [0.01, 0.01, -0.01]]
SP, SQ = np.diag([1e-4, 1e-4, 4e-4]), np.diag([1e-4, 4e-4, 9e-4])
START = FilterState(np.eye(3).ravel(), np.eye(9), 4.0 * np.eye(9))


def run(alpha, reset):
    state = START
    for q, p in zip(SOURCE, TARGET, strict=True):
        if reset:
            state = FilterState(state.x, state.Q1, START.Q2)
        state = hinfinity_step(state, rotation_model(q, SQ, SP), p, alpha, theta=0.1)
    return state


def test_hinfinity_gives_the_test_vector():
    state = run(alpha=0.01, reset=True)
    expected = [
        *(0.875724496842, -0.496627761759, -0.001528256661, 0.50092049285, 0.863306995085, 0.005870497751),
        *(-0.004962645116, -0.004962645116, 1.004937482397),
    ]
    np.testing.assert_allclose(state.x, expected, atol=1e-9)
    np.testing.assert_allclose(np.diag(state.Q1), [0.007508305272] * 6 + [0.00772930407] * 3, atol=1e-9)
    angle = np.degrees(np.linalg.norm(so3_log(nearest_rotation(state.x).T @ R30)))
    assert angle == pytest.approx(0.3956, abs=5e-5)


def test_hinfinity_with_a_running_second_moment_gives_the_test_vector():
    expected = [
        *(0.87356965362, -0.46896654365, -0.013633777358, 0.467666806334, 0.881636030189, 0.01274873253),
        *(-0.00466571182, -0.00466571182, 1.004446835428),
    ]
    np.testing.assert_allclose(run(alpha=0.1, reset=False).x, expected, atol=1e-9)


def test_kalman_gives_the_test_vector():
    x, P = np.eye(3).ravel(), np.eye(9)
    for q, p in zip(SOURCE, TARGET, strict=True):
        x, P = kalman_step(x, P, q, p, SP)
    expected = [
        *(0.876022202589, -0.499965602415, -0.0000155974, 0.504958779525, 0.861048574330, 0.005008774526),
        *(-0.004998500550, -0.004998500550, 1.004997501050),
    ]
    np.testing.assert_allclose(x, expected, atol=1e-9)
    np.testing.assert_allclose(np.diag(P), [7.499312567e-5] * 6 + [2.998900430e-4] * 3, atol=1e-9)


def test_without_uncertainty_hinfinity_is_kalman():
    state, x, P = START, np.eye(3).ravel(), np.eye(9)
    for q, p in zip(SOURCE, TARGET, strict=True):
        state = hinfinity_step(state, rotation_model(q, 0 * SQ, SP, rho=0.0), p, alpha=1.0, theta=0.0)
        x, P = kalman_step(x, P, q, p, SP)
    np.testing.assert_allclose(state.x, x, atol=1e-12)
    np.testing.assert_allclose(state.Q1, P, atol=1e-12)


def test_one_motion_collapses_to_the_information_form():
    """Y+ = Y - theta^2 L'L + C' inv(S_k) C with S_k = Sp + alpha rho^2 I."""
    Y, x = np.eye(9), np.eye(3).ravel()
    for q, p in zip(SOURCE, TARGET, strict=True):
        C, W = np.kron(np.eye(3), q), np.linalg.inv(SP + 0.01 * np.eye(3))
        before = Y - 0.1**2 * np.eye(9)
        Y = before + C.T @ W @ C
        x = np.linalg.solve(Y, before @ x + C.T @ W @ p)
    state = run(alpha=0.01, reset=True)
    np.testing.assert_allclose(state.x, x, atol=1e-12)
    np.testing.assert_allclose(np.linalg.inv(state.Q1), Y, rtol=1e-9)


@pytest.mark.parametrize(("alpha", "theta"), [(1e-3, 0.1), (0.01, 1.0)])
def test_infeasible_parameters_are_refused(alpha, theta):
    with pytest.raises(InputError, match=r"alpha|theta"):
        hinfinity_step(START, rotation_model(SOURCE[0], SQ, SP), TARGET[0], alpha, theta)
