"""The key frame that a map begins with is where the camera was at its stamp, as all others are."""

import numpy as np
import pytest
from drawn import frame

from odom.backend import Odometry
from odom.backend.map.memory import saved_keyframe
from odom.geometry import se3
from sensors.arena import ArenaOptions

FIRST, COUNT = 500, 60
"""Of the frames of a walk: where the camera moves at an even pace, .2 m/s."""


@pytest.mark.parametrize("seed", [1, 2])
def test_the_first_key_frame_is_saved_where_the_camera_was_at_its_stamp(seed):
    options = ArenaOptions(seed=seed)
    drawn = [frame(options, FIRST + k) for k in range(COUNT)]
    odometry = Odometry(options.camera)
    for each in drawn:
        odometry.process(each.rgbd())
    odometry.finish()
    saved = [saved_keyframe(odometry.map, n) for n in range(len(odometry.map.keyframes))]
    assert len(saved) > 1
    true = {each.stamp: each.T_world_camera for each in drawn}
    T_map_camera = [se3.inverse(k.T_camera_map) @ k.T_middle_stamp for k in saved]
    for k, T in zip(saved[1:], T_map_camera[1:], strict=True):
        T_true = se3.inverse(true[saved[0].stamp]) @ true[k.stamp]
        off = se3.log(se3.inverse(T_true) @ se3.inverse(T_map_camera[0]) @ T)
        assert np.linalg.norm(off[:3]) < 2e-3, "3 to 4 mm where the middle row's pose is taken for that of the stamp"
        assert np.rad2deg(np.linalg.norm(off[3:])) < 0.05
