"""Poses that are predicted through frames which show nothing err as much as their covariance says."""

from dataclasses import replace

import drawn
import numpy as np

from odom.backend import Odometry, OdometrySettings, State
from odom.geometry import se3
from sensors.arena import ArenaOptions

OPTIONS = ArenaOptions(seed=1)
FIRST, FRAMES = 30, 84
EVERY, TRACKED = 12, 9
"""Of so many frames so many show the scene, the others a grey field."""


def squared_errors(bridge_s, tracked):
    """Return the normalised squared errors (n, 6 in the mean) of predicted motions since the last tracked frame."""
    found = []
    odometry, last = Odometry(OPTIONS.camera, OdometrySettings(bridge_s=bridge_s)), None
    for i in range(FRAMES):
        shown = drawn.frame(OPTIONS, FIRST + i)
        frame = shown.rgbd()
        if i % EVERY >= tracked and i > EVERY:
            frame = replace(frame, color=np.full_like(frame.color, 90))
        estimate = odometry.process(frame)
        if estimate.state is State.TRACKING:
            last = shown.T_world_camera, estimate
        elif estimate.is_predicted and last is not None:
            T_truth = se3.inverse(last[0]) @ shown.T_world_camera
            T_predicted = se3.inverse(last[1].T_odom_camera) @ estimate.T_odom_camera
            error = se3.log(se3.inverse(T_predicted) @ T_truth)
            found.append(error @ np.linalg.solve(estimate.covariance - last[1].covariance, error))
    return found


def test_predicted_poses_are_neither_too_sure_nor_as_vague_as_if_the_camera_could_be_anywhere():
    found = squared_errors(OdometrySettings().bridge_s, TRACKED)
    assert len(found) > 12
    assert 0.2 < np.mean(found) < 9.0


def test_poses_predicted_for_a_second_are_not_too_sure():
    found = squared_errors(1.0, EVERY // 2)
    assert len(found) > 24
    assert np.mean(found) < 9.0
