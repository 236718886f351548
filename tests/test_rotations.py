import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from odom.geometry import rotations, se3
from odom.geometry.arrays import Array

ANGLES = [0.0, 1e-12, 1e-7, 1e-5, 1e-3, 1.0, 3.0, np.pi - 1e-9]


def vectors(angle: float) -> Array:
    axes = np.random.default_rng(3).normal(size=(50, 3))
    return angle * axes / np.linalg.norm(axes, axis=1)[:, None]


@pytest.mark.parametrize("angle", ANGLES)
def test_matrices_quaternions_and_vectors_are_those_of_scipy(angle: float) -> None:
    known = Rotation.from_rotvec(vectors(angle))
    R = known.as_matrix()
    assert rotations.matrices_of_vectors(vectors(angle)) == pytest.approx(R, abs=1e-14)
    assert rotations.quaternions_of(R) == pytest.approx(known.as_quat(canonical=True), abs=1e-8)
    assert rotations.matrices_of(3.0 * known.as_quat()) == pytest.approx(R, abs=1e-14)
    assert rotations.vectors_of(R) == pytest.approx(vectors(angle), abs=1e-12)
    assert rotations.angles_of(R) == pytest.approx(np.full(50, angle), abs=1e-12)


def test_the_mean_is_that_of_scipy() -> None:
    R = Rotation.from_rotvec(vectors(0.3) + 1.0).as_matrix()
    assert rotations.mean_of(R) == pytest.approx(Rotation.from_matrix(R).mean().as_matrix(), abs=1e-12)


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_turn_onto_other_vectors_is_that_of_scipy_and_never_a_reflection(mirrored: bool) -> None:
    rng = np.random.default_rng(1)
    onto = rng.normal(size=(40, 3)) * (1.0, 0.7, 0.4)
    given = onto @ rotations.matrices_of_vectors(np.array([[0.3, -0.9, 1.7]]))[0] + 0.05 * rng.normal(size=(40, 3))
    given[:, 0] *= -1.0 if mirrored else 1.0
    R = rotations.turn_onto(given, onto)
    assert pytest.approx(Rotation.align_vectors(onto, given)[0].as_matrix(), abs=1e-12) == R
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_of_none_there_are_none() -> None:
    none = np.zeros((0, 3, 3))
    assert rotations.quaternions_of(none).shape == (0, 4)
    assert rotations.vectors_of(none).shape == (0, 3)
    assert rotations.matrices_of(np.zeros((0, 4))).shape == (0, 3, 3)
    assert rotations.matrices_of_vectors(np.zeros((0, 3))).shape == (0, 3, 3)
    assert se3.logs(np.zeros((0, 4, 4))).shape == (0, 6)


@pytest.mark.parametrize("angle", ANGLES)
@given(st.integers(0, 1000))
def test_many_tangents_and_adjoints_are_those_of_one(angle: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    T = np.array([se3.exp(np.r_[rng.normal(size=3), phi]) for phi in vectors(angle)[:5]])
    assert se3.logs(T) == pytest.approx(np.array([se3.log(one) for one in T]), abs=1e-7 if angle > 3.1 else 1e-12)
    np.testing.assert_allclose(se3.adjoints(T), np.array([se3.adjoint(one) for one in T]), rtol=1e-13, atol=1e-15)
