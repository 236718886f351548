"""What a motion's covariance holds beside noise: everything measured may be too long, or too short, by one share."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from odom.backend.map.pose_covariance import unit_covariance
from odom.backend.map.tuning import TUNING
from odom.geometry import se3

SIGMA = 1e-6
"""Of all else (m, rad)."""

motions = st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6).map(lambda numbers: se3.exp(np.array(numbers)))


@given(motions, st.floats(-3.0, 3.0))
def test_a_motion_told_in_another_unit_of_length_is_off_by_as_many_sigmas_as_the_unit(T, sigmas):
    stretched = T.copy()
    stretched[:3, 3] *= 1.0 + sigmas * TUNING.unit_of_length
    error = se3.log(se3.inverse(T) @ stretched)
    nees = error @ np.linalg.solve(unit_covariance(T) + SIGMA**2 * np.eye(6), error)
    assert nees <= sigmas**2 + 1e-6
    if np.linalg.norm(T[:3, 3]) > 0.1:
        np.testing.assert_allclose(nees, sigmas**2, rtol=1e-3, atol=1e-6)


@given(motions)
def test_neither_turns_nor_what_is_beside_the_motion_are_less_sure_for_the_unit(T):
    C = unit_covariance(T)
    assert not C[3:].any()
    along = T[:3, :3].T @ T[:3, 3]
    beside = np.cross(along, [0.3, -0.5, 0.8])
    assert abs(beside @ C[:3, :3] @ beside) < 1e-12
    T[:3, 3] = 0.0
    assert not unit_covariance(T).any()
