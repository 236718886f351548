"""Smoothing of the final trajectory: noise from frame to frame goes, motion stays, and so does what says too little."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import make_smoothing_spline
from scipy.spatial.transform import Rotation

from odom.backend import TrajectoryPose
from odom.backend.odometry.smoothing import smoothed, smoothed_positions
from odom.frame import Stamp
from odom.geometry import se3

COUNT = 200
SECONDS = np.arange(COUNT) / 30.0


def walked(seconds):
    """Positions (N x 3, m) of a hand that sways and trembles."""
    return np.column_stack([0.3 * np.sin(2.0 * seconds), 0.02 * np.sin(12.0 * seconds), 0.1 * seconds])


def noisy(seed, sigma_m=0.001):
    return walked(SECONDS) + sigma_m * np.random.default_rng(seed).standard_normal((COUNT, 3))


def rms(errors):
    return np.sqrt(np.mean(errors**2))


@given(st.integers(0, 1000))
def test_noise_from_frame_to_frame_falls_by_a_quarter_at_least(seed):
    before = noisy(seed)
    after = smoothed_positions(SECONDS, before)
    assert rms(after - walked(SECONDS)) < 0.75 * rms(before - walked(SECONDS))


@given(st.integers(0, 1000))
def test_precise_positions_stay_within_a_tenth_of_a_millimetre(seed):
    shaken = walked(SECONDS)
    at = int(np.random.default_rng(seed).integers(0, COUNT - 30))
    shaken[at : at + 30, 0] += 0.02 * np.sin(np.arange(30) / 30.0 * 10.0 * np.pi)
    np.testing.assert_allclose(smoothed_positions(SECONDS, shaken), shaken, atol=1e-4)


def test_a_camera_that_stands_is_found_far_better_than_a_frame_tells():
    noise = 0.001 * np.random.default_rng(1).standard_normal((COUNT, 3))
    assert rms(smoothed_positions(SECONDS, noise)) < 0.2 * rms(noise)
    still = np.ones((COUNT, 3))
    np.testing.assert_array_equal(smoothed_positions(SECONDS, still), still)


@pytest.mark.parametrize("seed", range(5))
def test_the_result_is_a_cubic_smoothing_spline_at_irregular_times_too(seed):
    rng = np.random.default_rng(seed)
    seconds = np.cumsum(rng.uniform(0.02, 0.2, COUNT))
    positions = walked(seconds) + 0.002 * rng.standard_normal((COUNT, 3))
    found = smoothed_positions(seconds, positions)
    usual_s = np.median(np.diff(seconds))
    apart = [
        np.abs(make_smoothing_spline(seconds, positions, lam=usual_s**3 * 2.0**power)(seconds) - found).max()
        for power in np.linspace(-np.log2(1e6), np.log2(1e6), 41)
    ]
    assert min(apart) < 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_with_weights_it_is_the_weighted_smoothing_spline(seed):
    rng = np.random.default_rng(seed)
    seconds, shares = np.cumsum(rng.uniform(0.02, 0.2, COUNT)), rng.uniform(0.1, 50.0, COUNT)
    positions = walked(seconds) + 0.002 * np.sqrt(shares)[:, None] * rng.standard_normal((COUNT, 3))
    found = smoothed_positions(seconds, positions, shares)
    usual_s = np.median(np.diff(seconds))
    apart = [
        np.abs(make_smoothing_spline(seconds, positions, 1.0 / shares, usual_s**3 * 2.0**power)(seconds) - found).max()
        for power in np.linspace(-np.log2(1e6), np.log2(1e6), 41)
    ]
    assert min(apart) < 1e-8


@given(st.integers(0, 1000))
def test_steps_of_a_walker_between_far_frames_are_not_taken_for_noise(seed):
    seconds = np.arange(COUNT) * 0.267
    steps = np.column_stack([0.3 * seconds, np.zeros(COUNT), 0.02 * np.sin(4.0 * np.pi * seconds + seed)])
    seen = steps + 0.0005 * np.random.default_rng(seed).standard_normal((COUNT, 3))
    poses = tuple(replace(pose, stamp=Stamp(round(s * 1e9))) for pose, s in zip(poses_of(seen), seconds, strict=True))
    found = np.array([pose.T_map_camera[:3, 3] for pose in smoothed(poses, np.full(COUNT, 0.001**2))])
    assert rms(found - steps) < 0.001
    assert rms(smoothed_positions(seconds, seen) - steps) > 0.002, "they look like noise"


@given(st.integers(0, 1000), st.integers(1, 4), st.integers(20, COUNT - 20))
def test_poses_that_claim_little_and_are_far_off_are_placed_by_the_others(seed, count, begin):
    sigma = np.full(COUNT, 0.001)
    sigma[begin : begin + count] = 0.05
    off = noisy(seed)
    off[begin : begin + count] += np.random.default_rng(seed).normal(0.0, 0.05, 3)
    found = np.array([pose.T_map_camera[:3, 3] for pose in smoothed(tuple(poses_of(off)), sigma**2)])
    assert np.abs(found - walked(SECONDS)).max() < 0.006


def test_a_first_pose_without_any_variance_and_a_walk_of_such_poses_are_smoothed_too():
    variances = np.full(COUNT, 0.0015**2)
    variances[0] = 0.0
    for given_variances in (variances, np.zeros(COUNT)):
        found = np.array([pose.T_map_camera[:3, 3] for pose in smoothed(tuple(poses_of(noisy(1))), given_variances)])
        assert rms(found - walked(SECONDS)) < 0.75 * rms(noisy(1) - walked(SECONDS))


@given(st.lists(st.floats(1e-100, 1e100) | st.sampled_from([0.0, np.inf, np.nan]), min_size=40, max_size=40))
def test_whatever_is_claimed_of_poses_their_positions_stay_finite(variances):
    found = smoothed(tuple(poses_of(noisy(1)[:40])), np.array(variances))
    assert np.isfinite([pose.T_map_camera for pose in found]).all()


@given(st.integers(0, 1000), st.floats(0.01, 100.0))
def test_it_does_not_matter_in_which_frame_and_unit_of_time_the_positions_are(seed, faster):
    R, t = Rotation.random(rng=seed).as_matrix(), np.array([1.0, -2.0, 3.0])
    before = noisy(seed)
    after = smoothed_positions(SECONDS, before)
    np.testing.assert_allclose(smoothed_positions(SECONDS / faster, before @ R.T + t), after @ R.T + t, atol=1e-7)


@given(st.lists(st.floats(1e-9, 10.0), min_size=40, max_size=40))
def test_frames_of_any_steps_in_time_give_finite_positions(steps):
    seconds = np.cumsum(steps)
    assert np.isfinite(smoothed_positions(seconds, noisy(1)[:40])).all()


def poses_of(positions, segment=0, first=0):
    out = []
    for number, position in enumerate(positions):
        T = se3.exp(np.array([0.0, 0.0, 0.0, 0.01 * number, 0.0, 0.0]))
        T[:3, 3] = position
        out.append(TrajectoryPose(Stamp((first + number) * 33_000_000), T, segment))
    return out


def test_each_segment_is_smoothed_by_itself_and_lost_frames_and_orientations_stay():
    one, few, other = poses_of(noisy(1)), poses_of(noisy(2)[:20], 1, 1000), poses_of(noisy(3) + 5.0, 2, 2000)
    one[50] = TrajectoryPose(one[50].stamp, None, 0)
    found = smoothed((*one, *few, *other), np.full(2 * COUNT + 20, np.nan))
    assert found[50] is one[50]
    assert found[COUNT : COUNT + 20] == tuple(few)
    for together, alone in zip(found[-COUNT:], smoothed(tuple(other), np.full(COUNT, np.nan)), strict=True):
        np.testing.assert_array_equal(together.T_map_camera, alone.T_map_camera)
    moved = [(a.T_map_camera, b.T_map_camera) for a, b in zip(found, one, strict=False) if b.T_map_camera is not None]
    assert max(np.abs(a[:3, 3] - b[:3, 3]).max() for a, b in moved) > 1e-4
    for a, b in moved:
        np.testing.assert_array_equal(a[:3, :3], b[:3, :3])


def test_where_stamps_come_again_each_time_is_smoothed_by_itself():
    once, again = poses_of(noisy(1)), poses_of(noisy(2))
    found = smoothed((*once, *again), np.full(2 * COUNT, np.nan))
    alone = [*smoothed(tuple(once), np.full(COUNT, np.nan)), *smoothed(tuple(again), np.full(COUNT, np.nan))]
    for one, other in zip(found, alone, strict=True):
        np.testing.assert_array_equal(one.T_map_camera, other.T_map_camera)
