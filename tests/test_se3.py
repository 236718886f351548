import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from odom.registration import se3

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
