"""Calibration against the arena's motion capture, with its gaps, noise and clock; nothing is rendered."""

import numpy as np
import pytest
from evo.core import metrics as evo_metrics
from synthetic import odometry
from test_evo_agreement import to_evo

from odom.evaluation import Trajectory, evaluate
from odom.evaluation.mocap_calibration import calibrate
from odom.evaluation.truth_noise import truth_noise
from odom.geometry import se3
from sensors.arena.camera_path import make_walk
from sensors.arena.motion_capture import POSITION_M, RATE_HZ, ROTATION_RAD, T_camera_marker, mocap_pose
from sensors.arena.options import ArenaOptions


@pytest.fixture(scope="module", params=[1, pytest.param(2, marks=pytest.mark.long)])
def session(request):
    """The camera's exact trajectory, a drifting estimate of it as good as this odometry's, mocap and options."""
    options = ArenaOptions(seed=request.param)
    walk = make_walk(options)
    times = np.arange(options.frames) / 30.0
    stamps = options.start + np.round(times * 1e9).astype(np.int64)
    exact = Trajectory(stamps, np.array([walk.T_world_camera(t) for t in times]))
    estimate = odometry(
        np.random.default_rng(request.param), exact, step_m=2e-4, step_rad=1e-4, pull=0.97, white_m=5e-4, white_rad=2e-4
    )
    poses = [pose for k in range(int(times[-1] * RATE_HZ)) if (pose := mocap_pose(options, k))]
    found = {int(pose.stamp): pose.T_mocap_marker for pose in poses}
    mocap = Trajectory(np.array(sorted(found)), np.array([found[stamp] for stamp in sorted(found)]))
    return options, exact, estimate, mocap


def test_offset_hand_eye_and_ate_are_those_of_the_simulation(session):
    options, exact, estimate, mocap = session
    found = calibrate(estimate, mocap)
    error = se3.log(se3.inverse(found.T_body_camera) @ se3.inverse(T_camera_marker(options)))
    assert abs(found.offset_s - options.mocap_offset_s) < 0.002
    assert np.linalg.norm(error[:3]) < 0.003
    assert np.degrees(np.linalg.norm(error[3:])) < 0.3
    truth = found.camera_truth(mocap)
    judged = truth.at(estimate.stamps, 0.1)[1]
    with_exact = evaluate(estimate.take(judged), exact).ate_m
    assert evaluate(estimate, truth).ate_m == pytest.approx(with_exact, rel=0.05)


def test_ate_agrees_with_evo_on_the_arena(session):
    _, exact, estimate, _ = session
    report = evaluate(estimate, exact)
    aligned, reference = to_evo(estimate), to_evo(exact)
    aligned.align(reference, correct_scale=False)
    ape = evo_metrics.APE(evo_metrics.PoseRelation.translation_part)
    ape.process_data((reference, aligned))
    assert report.ate_m == pytest.approx(ape.get_statistic(evo_metrics.StatisticsType.rmse), abs=1e-9)
    rpe = evo_metrics.RPE(evo_metrics.PoseRelation.rotation_angle_deg, delta=1, delta_unit=evo_metrics.Unit.frames)
    rpe.process_data((reference, aligned))
    assert report.rpe_frame.rmse_deg == pytest.approx(rpe.get_statistic(evo_metrics.StatisticsType.rmse), abs=1e-6)


def test_the_truths_noise_is_found_from_its_own_samples(session):
    _, _, _, mocap = session
    noise = truth_noise(mocap)
    assert noise is not None
    assert noise.sigma_m == pytest.approx(POSITION_M, rel=0.15)
    assert noise.sigma_rad == pytest.approx(ROTATION_RAD, rel=0.15)
