from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_scene import RAY_SIGMA, made_up_bundle, project, robust_cost

from odom.backend.mapping.bundle_adjustment import Bundle, adjust
from odom.backend.mapping.observations import Observations
from odom.geometry import se3

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


def exact_bundle(points=60):
    """A bundle that starts where it belongs, with observations free of noise: every step fails."""
    made = made_up_bundle(2, points=points, timing_change=(0.0, 0.0, 0.0))
    o = made.observations
    values = np.concatenate(
        [project(made.T_camera_map[k], made.landmarks[p : p + 1]) for k, p in zip(o.keyframe, o.landmark, strict=True)]
    )
    values[np.isnan(o.values)] = np.nan
    return Bundle(made.T_camera_map, made.landmarks, np.zeros(3)), replace(o, values=values)


def information(bundle, observations):
    """Information of (free poses, landmarks, timing), by differences; the residuals are zero, all weights one."""
    o, h = observations, 1e-6
    poses, landmarks = 6 * np.count_nonzero(~FIXED), 3 * len(bundle.landmarks)
    H = np.zeros((poses + landmarks + 3, poses + landmarks + 3))
    for k, p, K, value, (xx, xy, yy, ww) in zip(
        o.keyframe, o.landmark, o.jacobian_timing, o.values, o.variances, strict=True
    ):
        T, X = bundle.T_camera_map[k], bundle.landmarks[p : p + 1]
        by_pose, by_point = (
            np.array([(seen(h * e) - seen(-h * e)) / (2 * h) for e in np.eye(n)]).T
            for n, seen in (
                (6, lambda xi, T=T, X=X: project(se3.exp(xi) @ T, X)[0]),
                (3, lambda step, T=T, X=X: project(T, X + step)[0]),
            )
        )
        A = np.zeros((3, len(H)))
        if not FIXED[k]:
            free = 6 * np.count_nonzero(~FIXED[:k])
            A[:, free : free + 6] = by_pose
        A[:, poses + 3 * p : poses + 3 * p + 3] = by_point
        A[:, -3:] = -K
        C = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, ww]])
        known = np.isfinite(value)
        H += A[known].T @ np.linalg.solve(C[np.ix_(known, known)], A[known])
    return H


def test_what_it_says_of_landmarks_and_timing_is_of_the_observations_however_many_steps_failed():
    start, observations = exact_bundle()
    found = adjust(start, FIXED, observations, NO_PRIOR, 20)
    np.testing.assert_array_equal(found.landmarks, start.landmarks)
    H = information(start, observations)
    poses = 6 * np.count_nonzero(~FIXED)
    for p, covariance in enumerate(found.covariances):
        here = slice(poses + 3 * p, poses + 3 * p + 3)
        np.testing.assert_allclose(covariance, np.linalg.inv(H[here, here]), rtol=1e-5, atol=1e-12)
    marginal = H[-3:, -3:] - H[-3:, :-3] @ np.linalg.solve(H[:-3, :-3], H[:-3, -3:])
    np.testing.assert_allclose(found.information_timing, marginal, rtol=1e-4)


def test_a_landmark_of_one_ray_is_known_across_it_and_not_along_it():
    start, o = exact_bundle()
    values = o.values.copy()
    alone = np.zeros(len(values), dtype=bool)
    alone[np.flatnonzero(o.landmark == 0)[1:]] = True
    values[np.flatnonzero(o.landmark == 0)[0], 2] = np.nan
    kept = [a[~alone] for a in (o.keyframe, o.landmark, values, o.jacobian_timing, o.variances)]
    covariance = adjust(start, FIXED, Observations(*kept), NO_PRIOR, 20).covariances[0]
    sizes, axes = np.linalg.eigh(covariance)
    T = start.T_camera_map[o.keyframe[0]]
    ray = start.landmarks[0] - se3.inverse(T)[:3, 3]
    depth = np.linalg.norm(ray)
    assert abs(axes[:, 2] @ ray) == pytest.approx(depth, rel=1e-6)
    assert 100.0 < sizes[2] < np.inf
    assert (sizes[:2] > 0.0).all()
    assert (sizes[:2] < (2.0 * RAY_SIGMA * depth) ** 2).all()
