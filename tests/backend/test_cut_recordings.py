"""Recordings out of which pieces were cut, with stamps that count on: what the camera jumps by is no motion of it."""

from dataclasses import replace

import drawn
import numpy as np
import pytest

from odom.backend import Odometry, State
from odom.backend.odometry.tuning import TUNING
from odom.backend.tracking.motion_model import MotionFilter, ProcessNoise
from odom.geometry import se3
from sensors.arena import ArenaOptions

OPTIONS = ArenaOptions(seed=1)
PERIOD_NS = 33_333_333
KEPT, CUT, PIECES = 24, 20, 4
POSE = np.diag([0.0004] * 3 + [0.0003] * 3) ** 2


def test_a_jump_is_not_taken_for_motion_but_a_jerk_is():
    course = MotionFilter.begun(np.eye(4), POSE, ProcessNoise())
    for k in range(1, 60):
        course = course.updated(se3.exp(np.array([0.01 * k, 0, 0, 0, 0, 0])), POSE, 1 / 30)
    jerk = np.array([0.6 + 0.5 * 8.0 / 30**2, 0, 0, 0, 0, 0.5 * 20.0 / 30**2])
    assert course.surprise(se3.exp(jerk), POSE, 1 / 30) < TUNING.cut_chi2
    assert course.surprise(se3.exp(np.array([0.75, 0, 0, 0, 0, 0])), POSE, 1 / 30) > TUNING.cut_chi2


@pytest.fixture(scope="module")
def cut():
    """The estimates of frames with pieces cut out between them, and the true poses, by stamp."""
    odometry, estimates, truth = Odometry(OPTIONS.camera), [], {}
    kept = [piece * (KEPT + CUT) + k for piece in range(PIECES) for k in range(KEPT)]
    for i, number in enumerate(kept):
        shown = drawn.frame(OPTIONS, number)
        frame = shown.rgbd()
        stamp = OPTIONS.start + i * PERIOD_NS
        depth_stamp = stamp + frame.depth_stamp - frame.stamp
        estimates.append(odometry.process(replace(frame, sequence=i, stamp=stamp, depth_stamp=depth_stamp)))
        truth[stamp] = shown.T_world_camera
    return estimates, truth


def test_poses_behind_a_cut_are_not_carried_by_a_speed_that_never_was(cut):
    estimates, truth = cut
    moved = [e for e in estimates if e.state is State.TRACKING and e.second is not None]
    assert len(moved) > KEPT
    errors = []
    for estimate in moved:
        T_truth = se3.inverse(truth[estimate.second.stamp_earlier]) @ truth[estimate.stamp]
        error = se3.log(se3.inverse(estimate.second.T_earlier_current) @ T_truth)
        errors.append(np.linalg.norm(error[:3]))
    assert max(errors) < 0.05


def test_no_motion_begins_or_ends_at_a_predicted_pose(cut):
    estimates, _ = cut
    predicted = {estimate.stamp for estimate in estimates if estimate.is_predicted}
    motions = [(e.stamp, one.stamp_earlier) for e in estimates for one in (e.step, e.second) if one is not None]
    assert predicted
    assert motions
    assert predicted.isdisjoint(stamp for ends in motions for stamp in ends)
