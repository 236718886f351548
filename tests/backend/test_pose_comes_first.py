"""The pose of a tracked frame is told before the chain and the map go on, and is the one that is returned."""

from dataclasses import replace

import numpy as np

from odom.backend import Odometry
from odom.frame import Stamp


def test_the_pose_is_told_before_the_map_grows_and_nothing_of_it_changes_after(arena):
    odometry, told, keyframes = Odometry(arena[0]), [], []

    def on_pose(estimate):
        told.append(estimate)
        keyframes.append(len(odometry.map.keyframes))

    for drawn in arena[1]:
        before = len(told)
        estimate = odometry.process(drawn.rgbd(), on_pose)
        if len(told) == before:
            assert estimate.sequence == 0  # a first frame is not tracked
            continue
        assert len(odometry.map.keyframes) - keyframes[-1] == estimate.is_keyframe
        early = told[-1]
        assert (early.chain, early.pairwise, early.is_keyframe) == (None, None, False)
        for name in ("sequence", "stamp", "state", "reason", "segment", "inliers", "matches"):
            assert getattr(early, name) == getattr(estimate, name)
        for name in ("T_odom_camera", "covariance", "T_map_odom"):
            np.testing.assert_array_equal(getattr(early, name), getattr(estimate, name))
    assert len(told) == len(arena[1]) - 1
    assert max(keyframes) > 1


def test_no_pose_is_told_of_a_frame_that_is_not_tracked(arena):
    odometry, told = Odometry(arena[0]), []
    for drawn in arena[1][:10]:
        odometry.process(drawn.rgbd(), told.append)
    dark = arena[1][10].rgbd()
    later = Stamp(dark.stamp + 3_000_000_000)
    dark = replace(dark, color=np.zeros_like(dark.color), stamp=later, depth_stamp=later)
    assert odometry.process(dark, told.append).T_odom_camera is None
    assert len(told) == 9
