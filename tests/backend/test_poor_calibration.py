"""Motions by a camera whose focal length is wrong err in proportion to them, and are said to."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom, stroll

from odom import Odometry, Trajectory
from odom.evaluation.robustness.verdict import verdict


@pytest.mark.parametrize("percent", [0.0, 0.5, 1.0, 2.0])
def test_a_focal_length_that_is_off_leaves_motions_over_a_second_as_sure_as_they_are(percent):
    """Half a per cent was not noticed: errors were ten times what was claimed."""
    room, poses = PaintedRoom(), [stroll(3.0 * k / 30.0) for k in range(150)]
    frames = [room.frame(SMALL, k, T) for k, T in enumerate(poses)]
    longer = 1.0 + 0.01 * percent
    odometry = Odometry(replace(SMALL, fx=longer * SMALL.fx, fy=longer * SMALL.fy))
    estimates = [odometry.process(frame) for frame in frames]
    truth = Trajectory(np.array([frame.stamp for frame in frames]), np.array(poses))
    judged = verdict(estimates, Trajectory.of(odometry.finish()), truth)
    assert judged.wrong == 0.0
    assert judged.nees is not None
    assert 0.2 < judged.nees < 11.0
