"""Clock offset and hand-eye against motion capture that is synthesised here, never told to the program."""

import numpy as np
import pytest
from synthetic import T_BODY_CAMERA, mocap, odometry, on_a_floor, smooth, trajectory

from odom.errors import InputError
from odom.evaluation import Trajectory, evaluate
from odom.evaluation.clock_offset import clock_offset
from odom.evaluation.mocap_calibration import CalibrationOptions, calibrate
from odom.geometry import se3

FRAMES = np.arange(0.0, 30.0, 1 / 15)


def scene(seed, offset_s, frames=FRAMES, **motion):
    rng = np.random.default_rng(seed)
    pose = smooth(rng, **motion)
    true = trajectory(pose, frames)
    return true, odometry(rng, true), mocap(rng, pose, 31.0, offset_s=offset_s)


@pytest.mark.parametrize(("seed", "offset_s"), [(0, 0.037), (1, -0.5), (2, 2.2)])
def test_offset_and_hand_eye_are_recovered_within_their_uncertainty(seed, offset_s):
    _, estimate, truth = scene(seed, offset_s)
    found = calibrate(estimate, truth)
    error = se3.log(se3.inverse(found.T_body_camera) @ T_BODY_CAMERA)
    assert abs(found.offset_s - offset_s) < 0.002
    assert np.linalg.norm(error[:3]) < 0.005
    assert np.degrees(np.linalg.norm(error[3:])) < 0.3
    assert (np.abs(error) < 4 * found.hand_eye_sigma).all()
    assert abs(found.offset_s - offset_s) < 4 * found.offset_sigma_s
    assert found.notes == ()


@pytest.mark.parametrize("rate_hz", [15.0, 30.0, 60.0])
def test_of_a_recording_of_seconds_no_more_is_claimed_than_is_known(rate_hz):
    found = []
    for seed in range(20, 44):
        _, estimate, truth = scene(seed, 0.02, np.arange(0.0, 3.0, 1.0 / rate_hz))
        calibrated = calibrate(estimate, truth)
        error = se3.log(se3.inverse(calibrated.T_body_camera) @ T_BODY_CAMERA)
        found += [*(error / calibrated.hand_eye_sigma), (calibrated.offset_s - 0.02) / calibrated.offset_sigma_s]
    assert np.sqrt(np.mean(np.square(found))) < 1.3


def test_the_offset_of_a_slow_camera_that_moves_gently_is_no_surer_than_it_is():
    """Speeds of few and noisy poses leave it tens of milliseconds off, from where it was hardly moved."""
    found = []
    for seed in range(60, 66):
        rng = np.random.default_rng(seed)
        pose = smooth(rng, metres=0.12, radians=0.12, knot_s=2.0)
        estimate = odometry(rng, trajectory(pose, FRAMES), white_m=0.003, white_rad=0.004)
        truth = mocap(rng, pose, 31.0, offset_s=0.02, noise_m=1e-3, noise_rad=4e-3)
        calibrated = calibrate(estimate, truth)
        found.append((calibrated.offset_s - 0.02) / calibrated.offset_sigma_s)
    assert np.sqrt(np.mean(np.square(found))) < 2.0


def test_ate_with_the_found_calibration_is_that_with_exact_truth():
    true, estimate, truth = scene(3, 0.037)
    exact = evaluate(estimate, true).ate_m
    assert evaluate(estimate, calibrate(estimate, truth).camera_truth(truth)).ate_m == pytest.approx(exact, rel=0.05)


def test_clocks_without_a_common_epoch_are_brought_together():
    _, estimate, truth = scene(4, 0.0)
    assert calibrate(estimate, truth.delayed(-1000.0)).offset_s == pytest.approx(-1000.0, abs=0.002)


@pytest.mark.parametrize("rate_hz", [100.0, 120.0, 240.0])
def test_offset_is_not_pulled_to_the_samples_of_a_noisy_truth(rate_hz):
    rng = np.random.default_rng(5)
    pose = smooth(rng)
    estimate = odometry(rng, trajectory(pose, FRAMES))
    for offset_s in (0.001, 0.003):
        truth = mocap(rng, pose, 31.0, rate_hz, offset_s, noise_m=5e-4, noise_rad=2e-3)
        assert calibrate(estimate, truth).offset_s == pytest.approx(offset_s, abs=0.0007)


def test_imposed_values_are_kept_and_have_no_uncertainty():
    _, estimate, truth = scene(6, 0.037)
    found = calibrate(estimate, truth, CalibrationOptions(offset_s=0.036, T_body_camera=T_BODY_CAMERA))
    assert found.offset_s == 0.036
    np.testing.assert_array_equal(found.T_body_camera, T_BODY_CAMERA)
    assert found.offset_sigma_s == 0
    assert not found.hand_eye_sigma.any()


def test_wild_mocap_samples_do_not_spoil_the_calibration():
    _, estimate, truth = scene(7, 0.037)
    rng = np.random.default_rng(0)
    poses = truth.T_world_body.copy()
    for start in rng.integers(0, len(poses) - 40, 12):
        poses[start : start + 10] = poses[start : start + 10] @ se3.exp(rng.normal(0, 1.0, 6))
    found = calibrate(estimate, Trajectory(truth.stamps, poses))
    error = se3.log(se3.inverse(found.T_body_camera) @ T_BODY_CAMERA)
    assert abs(found.offset_s - 0.037) < 0.002
    assert np.linalg.norm(error[:3]) < 0.006


def test_without_turns_the_lever_arm_is_said_to_be_unknown():
    _, estimate, truth = scene(8, 0.0, FRAMES[:200], radians=1e-4)
    found = calibrate(estimate, truth)
    assert any("translation is known only" in note for note in found.notes)
    assert found.hand_eye_sigma[:3].max() > 0.05


@pytest.mark.parametrize("noise_rad", [3e-4, 1e-3, 3e-3])
def test_a_body_that_turns_about_one_axis_shows_nothing_of_the_lever_arm_along_it(noise_rad):
    """Its other turns are the noise of motion capture, to which metres of lever arm were fitted."""
    rng = np.random.default_rng(15)
    pose = on_a_floor(rng)
    true = trajectory(pose, FRAMES)
    estimate, T_body_camera = odometry(rng, true), se3.exp(np.array([0.05, -0.04, 0.1, 0.3, -0.35, 0.25]))
    truth = mocap(
        rng, lambda times: pose(times) @ T_body_camera, 31.0, T_body_camera=T_body_camera, noise_rad=noise_rad
    )
    estimate = estimate.of_body(T_body_camera)
    found = calibrate(estimate, truth)
    error = se3.log(se3.inverse(found.T_body_camera) @ T_body_camera)
    assert np.abs(found.T_body_camera[:2, 3] - T_body_camera[:2, 3]).max() < 0.02
    assert (np.abs(error) < 3 * found.hand_eye_sigma).all()
    assert np.linalg.norm(found.hand_eye_sigma[:3]) == pytest.approx(1.0, abs=0.05)
    assert any("taken as 0 m" in note for note in found.notes)
    exact = calibrate(estimate, truth, CalibrationOptions(T_body_camera=T_body_camera))
    ate, best = (evaluate(estimate, by.camera_truth(truth)).ate_m for by in (found, exact))
    assert ate == pytest.approx(best, rel=0.1)


@pytest.mark.parametrize("offset_s", [0.0, 1.3])
def test_a_camera_that_does_not_turn_is_brought_together_by_its_linear_speed(offset_s):
    _, estimate, truth = scene(16, offset_s, radians=0.0)
    found = calibrate(estimate, truth)
    turn = se3.log(se3.inverse(found.T_body_camera) @ T_BODY_CAMERA)[3:]
    assert abs(found.offset_s - offset_s) < min(0.002, 4 * found.offset_sigma_s)
    assert (np.abs(turn) < 4 * found.hand_eye_sigma[3:]).all()
    assert np.degrees(np.linalg.norm(turn)) < 1.0


def test_a_guessed_offset_may_lie_anywhere_in_the_range_that_was_searched():
    _, estimate, truth = scene(9, 0.0, FRAMES[:200], radians=1e-6, metres=1e-6)
    assert calibrate(estimate, truth).offset_sigma_s > 1.0
    assert calibrate(estimate, truth, CalibrationOptions(search_s=0.3)).offset_sigma_s == pytest.approx(0.17, abs=0.02)


def test_standing_still_is_said_to_settle_nothing():
    _, estimate, truth = scene(9, 0.0, FRAMES[:200], radians=1e-6, metres=1e-6)
    notes = " ".join(calibrate(estimate, truth).notes)
    assert "clock offset is a guess" in notes
    assert "translation is known only" in notes


def test_pure_rotation_still_gives_hand_eye():
    _, estimate, truth = scene(10, 0.02, metres=1e-3)
    found = calibrate(estimate, truth)
    error = se3.log(se3.inverse(found.T_body_camera) @ T_BODY_CAMERA)
    assert np.linalg.norm(error[:3]) < 0.006
    assert np.degrees(np.linalg.norm(error[3:])) < 0.4


def test_too_few_matches_are_an_error_that_says_so():
    _, estimate, truth = scene(11, 0.0)
    with pytest.raises(InputError, match="10 estimated poses"):
        calibrate(estimate.take(np.arange(10)), truth)
    with pytest.raises(InputError, match="3 estimated and 2 true"):
        calibrate(estimate.take(np.arange(3)), truth.take(np.arange(2)))


def test_what_does_not_move_at_all_is_no_calibration_and_no_crash():
    still = trajectory(lambda times: np.tile(np.eye(4), (len(times), 1, 1)), FRAMES)
    with pytest.raises(InputError, match="do not move"):
        calibrate(still, still)


def test_clock_offset_ignores_frames_and_worlds():
    true, _, truth = scene(12, 0.1234)
    assert clock_offset(true, truth.moved(se3.exp(np.ones(6)))).seconds == pytest.approx(0.1234, abs=0.004)


def test_errors_that_go_together_are_not_taken_for_a_lever_arm():
    """Seen from a camera a small turn looks like a small step: errors pivot about the scene, a metre ahead."""
    rng = np.random.default_rng(13)
    pose = smooth(rng, radians=0.15)
    true = trajectory(pose, FRAMES)

    def pivoting(sigma):
        phi = rng.normal(0, sigma, 3)
        return np.concatenate([rng.normal(0, sigma / 4, 3) - np.cross(phi, [0.0, 0.0, 1.0]), phi])

    drift, poses = np.zeros(6), []
    for T in true.T_world_body:
        drift = 0.97 * drift + se3.adjoint(T) @ pivoting(0.0008)
        poses.append(se3.exp(drift) @ T @ se3.exp(pivoting(0.0015)))
    found = calibrate(Trajectory(true.stamps, np.array(poses)), mocap(rng, pose, 31.0))
    error = se3.log(se3.inverse(found.T_body_camera) @ T_BODY_CAMERA)
    assert (np.abs(error) < 4 * found.hand_eye_sigma).all()
    assert np.linalg.norm(error[:3]) < 0.01
