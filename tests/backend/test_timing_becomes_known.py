"""The timing of a shutter is learnt from key frames: they are made until it is known, whatever the camera looks at."""

import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom, stroll

from odom import Camera
from odom.backend import Odometry
from odom.geometry import se3


@pytest.mark.parametrize("camera", [SMALL, Camera(640, 480, 525.0, 525.0, 319.5, 239.5)], ids=["small", "large"])
def test_the_timing_becomes_known_in_a_calm_walk_that_stays_in_one_place(camera):
    room = PaintedRoom()
    odometry = Odometry(camera)
    for k in range(150):
        odometry.process(room.frame(camera, k, se3.exp(0.5 * se3.log(stroll(k / 30.0)))))
    assert np.abs(odometry.timing.vector).max() < 0.004
