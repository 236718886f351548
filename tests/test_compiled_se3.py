"""Steps of a pose inside compiled loops are those of the plain functions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from odom.geometry import se3
from odom.geometry.compiled_se3 import moved, orthonormalise, solve_definite


@given(xi=arrays(float, 6, elements=st.floats(-2.0, 2.0)), at=arrays(float, 6, elements=st.floats(-2.0, 2.0)))
def test_a_step_is_the_exponential_times_the_pose(xi, at):
    T = se3.exp(at)
    np.testing.assert_allclose(moved(xi, T), se3.exp(xi) @ T, atol=1e-11)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-6, 0.99e-5, 1.01e-5])
def test_small_turns_are_exact_on_both_sides_of_the_series(size):
    xi = np.array([0.1, -0.2, 0.3, size, -size, 0.5 * size])
    np.testing.assert_allclose(moved(xi, np.eye(4)), se3.exp(xi), atol=1e-12)


@given(xi=arrays(float, 6, elements=st.floats(-2.0, 2.0)), noise=arrays(float, (3, 3), elements=st.floats(-1e-6, 1e-6)))
def test_a_drifted_rotation_is_brought_back_as_by_the_plain_function(xi, noise):
    T = se3.exp(xi)
    T[:3, :3] += noise
    expected = se3.orthonormal(T)
    orthonormalise(T)
    np.testing.assert_allclose(T, expected, atol=1e-14)


@given(A=arrays(float, (9, 6), elements=st.floats(-10.0, 10.0)), g=arrays(float, 6, elements=st.floats(-10.0, 10.0)))
def test_a_definite_system_is_solved(A, g):
    H = A.T @ A + np.eye(6)
    np.testing.assert_allclose(H @ solve_definite(H, g), g, atol=1e-8)


def test_an_indefinite_system_gives_no_numbers_that_could_be_taken_for_a_step():
    assert not np.isfinite(solve_definite(np.diag([1.0, 0.0, 1.0]), np.ones(3))).all()
