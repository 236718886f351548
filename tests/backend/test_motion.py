from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from odom.backend.tracking.motion_model import MotionFilter, ProcessNoise
from odom.geometry import se3

FINE_S = 1.0 / 240.0
AHEAD_S = 1.0 / 60.0
POSE_SIGMA = np.array([0.0004] * 3 + [0.0003] * 3)


@cache
def carried(seed, process_noise, seconds=30.0):
    """T_fixed_camera of a camera whose acceleration forgets itself in `steady_s`, every 1/240 s."""
    rng = np.random.default_rng(seed)
    sigma = np.repeat([process_noise.linear, process_noise.angular], 3)
    keep = np.exp(-FINE_S / process_noise.steady_s)
    T, twist, acceleration = np.eye(4), np.zeros(6), np.zeros(6)
    poses = []
    for _ in range(round(seconds / FINE_S)):
        poses.append(T)
        T = T @ se3.exp(twist * FINE_S)
        # a hand holds on to where it is: without that the speed would walk away
        acceleration = keep * acceleration + np.sqrt(1.0 - keep**2) * sigma * rng.normal(size=6)
        twist = twist * (1.0 - 0.8 * FINE_S) + acceleration * FINE_S
    return poses


def followed(seed, poses, stride):
    """The courses of the camera measured every `stride` fine steps, with the fine step that each ends at."""
    rng = np.random.default_rng(seed)
    covariance = np.diag(POSE_SIGMA**2)
    course, courses = None, []
    for k in range(0, len(poses), stride):
        measured = poses[k] @ se3.exp(POSE_SIGMA * rng.normal(size=6))
        if course is None:
            course = MotionFilter.begun(measured, covariance, ProcessNoise())
        else:
            course = course.updated(measured, covariance, stride * FINE_S)
        courses.append((k, course))
    return courses


@pytest.mark.parametrize("hertz", [120, 60, 30, 15, 8])
@pytest.mark.parametrize("process_noise", [ProcessNoise(0.3, 0.8), ProcessNoise(1.2, 4.0)], ids=["calm", "brisk"])
def test_what_is_predicted_errs_as_its_covariance_says_at_any_rate_and_process_noise(hertz, process_noise):
    poses = carried(1, process_noise)
    nees = []
    ahead = round(AHEAD_S / FINE_S)
    for k, course in followed(2, poses, round(1.0 / hertz / FINE_S))[2 * hertz :]:
        if k + ahead < len(poses):
            predicted = course.motion.after(AHEAD_S, course.process_noise)
            error = se3.log(se3.inverse(predicted.T_fixed_camera) @ poses[k + ahead])
            nees.append(error @ np.linalg.solve(predicted.covariance, error))
    assert 2.0 < np.mean(nees) < 9.0  # 6 expected
    assert np.mean(np.array(nees) < 14.45) > 0.85


@pytest.mark.parametrize("process_noise", [ProcessNoise(0.3, 0.8), ProcessNoise(1.2, 4.0)], ids=["calm", "brisk"])
def test_process_noise_is_learnt_from_the_motion(process_noise):
    courses = followed(4, carried(3, process_noise), round(1 / 15 / FINE_S))
    late = [course.process_noise for _, course in courses[len(courses) // 4 :]]
    assert 0.4 * process_noise.linear < np.median([a.linear for a in late]) < 1.7 * process_noise.linear
    assert 0.4 * process_noise.angular < np.median([a.angular for a in late]) < 1.7 * process_noise.angular


def test_a_jerk_after_rest_is_believed_at_once():
    rest = [np.eye(4)] * 1200
    jerked = [se3.exp(np.array([0.5 * 8.0 * (k * FINE_S) ** 2, 0, 0, 0, 0, 0])) for k in range(48)]
    courses = followed(5, [*rest, *jerked], 8)
    before, after = courses[len(rest) // 8 - 1][1].process_noise, courses[-1][1].process_noise
    assert after.linear > 2.0 * before.linear
    lag = [np.linalg.norm(c.motion.T_fixed_camera[:3, 3] - (rest + jerked)[k][:3, 3]) for k, c in courses]
    assert max(lag) < 0.003


def test_what_poses_err_by_is_no_acceleration_at_any_rate():
    rest = [np.eye(4)] * 2400
    learnt = {
        stride: followed(6, rest, stride)[-1][1].process_noise.linear for stride in (8, 2, 1)
    }  # 30, 120 and 240 Hz
    assert max(learnt[2], learnt[1]) < 3.0 * learnt[8]


def test_process_noise_never_falls_to_nothing():
    process_noise = ProcessNoise()
    for _ in range(1000):
        process_noise = process_noise.after(np.zeros(6), 0.033)
    assert process_noise.linear >= 0.1
    assert process_noise.angular >= 0.6
    assert np.linalg.eigvalsh(process_noise.carried(np.zeros((12, 12)), 0.033)).min() > -1e-18


def test_noise_grows_with_the_time():
    sizes = [np.diag(ProcessNoise().carried(np.zeros((12, 12)), dt)) for dt in (0.01, 0.03, 0.1, 0.3)]
    assert all((a < b).all() for a, b in pairwise(sizes))
