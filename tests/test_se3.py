import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from odom.geometry import se3

tangents = arrays(np.float64, 6, elements=st.floats(-1.7, 1.7, allow_nan=False))


@given(tangents)
def test_log_undoes_exp(xi):
    np.testing.assert_allclose(se3.log(se3.exp(xi)), xi, atol=1e-7)


@given(tangents, tangents)
def test_adjoint_moves_a_tangent_through_a_motion(a, b):
    T = se3.exp(a)
    np.testing.assert_allclose(T @ se3.exp(b), se3.exp(se3.adjoint(T) @ b) @ T, atol=1e-9)


@given(tangents)
def test_inverse_composes_to_identity(xi):
    T = se3.exp(xi)
    np.testing.assert_allclose(T @ se3.inverse(T), np.eye(4), atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_composed_covariance_matches_sampling(seed):
    rng = np.random.default_rng(seed)
    T_a_b, T_b_c = se3.exp(rng.normal(0, 0.7, 6)), se3.exp(rng.normal(0, 0.7, 6))
    roots = [0.01 * rng.normal(size=(6, 6)) for _ in range(2)]
    T_a_c = T_a_b @ T_b_c
    samples = [
        se3.log(
            se3.inverse(T_a_c)
            @ T_a_b
            @ se3.exp(roots[0] @ rng.normal(size=6))
            @ T_b_c
            @ se3.exp(roots[1] @ rng.normal(size=6))
        )
        for _ in range(4000)
    ]
    expected = se3.compose_covariance(roots[0] @ roots[0].T, T_b_c, roots[1] @ roots[1].T)
    deviation = np.cov(np.array(samples).T) - expected
    assert np.abs(deviation).max() < 0.12 * np.abs(expected).max()


@given(tangents, arrays(np.float64, (3, 3), elements=st.floats(-1e-6, 1e-6)))
def test_orthonormal_undoes_rounding(xi, noise):
    T = se3.exp(xi)
    T[:3, :3] += noise
    R = se3.orthonormal(T)[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-10)


@given(st.integers(0, 2), st.lists(st.floats(-1, 1), min_size=3, max_size=3), st.floats(0.0, 1e-3))
def test_turns_by_nearly_half_a_circle_have_their_logarithm(k, axis, less):
    axis = np.asarray(axis)
    axis[k] += np.copysign(1.5, axis[k])
    phi = (np.pi - less) * axis / np.linalg.norm(axis)
    R = Rotation.from_rotvec(phi).as_matrix()
    found = se3.so3_log(R)
    np.testing.assert_allclose(Rotation.from_rotvec(found).as_matrix(), R, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found), np.pi - less, atol=1e-9)
