"""The timing of a shutter is learnt from key frames: they are made until it is known, whatever the camera looks at."""

import numpy as np
from painted_room import SMALL, PaintedRoom, stroll

from odom.backend import Odometry
from odom.geometry import se3


def test_the_timing_becomes_known_in_a_calm_walk_that_stays_in_one_place():
    room = PaintedRoom()
    odometry = Odometry(SMALL)
    for k in range(150):
        odometry.process(room.frame(SMALL, k, se3.exp(0.5 * se3.log(stroll(k / 30.0)))))
    assert np.abs(odometry.timing.vector).max() < 0.004
