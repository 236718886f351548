from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_scene import made_up_bundle, robust_cost

from odom.backend.bundle import adjust
from odom.registration import se3

NO_PRIOR = np.diag([0.02**-2] * 3)
FIXED = np.arange(7) < 2


@pytest.mark.parametrize("seed", range(4))
def test_poses_landmarks_and_timing_are_recovered(seed):
    made = made_up_bundle(seed)
    found = adjust(made.start, FIXED, made.observations, NO_PRIOR, 20)
    before, after = (
        [np.linalg.norm(se3.log(T @ se3.inverse(A))) for T, A in zip(made.T_camera_map, b.T_camera_map, strict=True)]
        for b in (made.start, found)
    )
    assert max(after) < 0.003
    assert max(before) > 0.01
    off = np.linalg.norm(found.landmarks - made.landmarks, axis=1)
    assert np.median(off) < 0.006
    np.testing.assert_allclose(found.timing_change, made.timing_change, atol=0.002)


def test_the_timings_information_is_honest():
    chi2 = []
    for seed in range(25):
        made = made_up_bundle(seed, points=100)
        found = adjust(made.start, FIXED, made.observations, NO_PRIOR, 20)
        away = found.timing_change - made.timing_change
        chi2.append(away @ found.information_timing @ away)
    assert 1.5 < np.mean(chi2) < 5.4  # 3 expected


@settings(max_examples=20)
@given(st.integers(0, 10_000), st.floats(0.0, 8.0), st.floats(0.0, 0.3), st.integers(1, 6))
def test_the_cost_never_rises_and_fixed_poses_stay(seed, disturbed, outliers, iterations):
    made = made_up_bundle(seed, points=40, disturbed=disturbed, outliers=outliers)
    found = adjust(made.start, FIXED, made.observations, NO_PRIOR, iterations)
    before, after = (robust_cost(b, made.observations, NO_PRIOR) for b in (made.start, found))
    assert after <= before * (1.0 + 1e-9)
    assert (found.T_camera_map[FIXED] == made.start.T_camera_map[FIXED]).all()
    R = found.T_camera_map[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (7, 1, 1)), atol=1e-9)


def test_wrong_observations_do_not_bend_the_rest():
    made = made_up_bundle(3, outliers=0.1)
    found = adjust(made.start, FIXED, made.observations, NO_PRIOR, 30)
    away = [
        np.linalg.norm(se3.log(T @ se3.inverse(A))) for T, A in zip(made.T_camera_map, found.T_camera_map, strict=True)
    ]
    assert max(away) < 0.006


def test_a_camera_at_rest_tells_nothing_of_the_timing():
    made = made_up_bundle(1)
    o = made.observations
    resting = type(o)(o.keyframe, o.landmark, o.values, np.zeros_like(o.jacobian_timing), o.variances)
    start = replace(made.start, timing_change=np.array([0.001, -0.002, 0.003]))
    found = adjust(start, FIXED, resting, NO_PRIOR, 20)
    np.testing.assert_allclose(found.timing_change, 0.0, atol=1e-6)
    assert np.abs(found.information_timing).max() < 1e-3


def test_the_same_input_gives_the_same_bytes():
    made = made_up_bundle(5, points=60)
    a, b = (adjust(made.start, FIXED, made.observations, NO_PRIOR, 5) for _ in range(2))
    assert a.T_camera_map.tobytes() == b.T_camera_map.tobytes()
    assert a.landmarks.tobytes() == b.landmarks.tobytes()
