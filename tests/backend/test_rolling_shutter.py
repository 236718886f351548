"""A camera that reads its rows one after the other while it turns: landmarks are looked for where it shows them."""

import numpy as np
import pytest
from painted_room import PERIOD, SMALL, PaintedRoom, known_readout

from odom.backend import Odometry
from odom.geometry import se3

READOUT_S = 0.024
TURNS = [(1.5, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 1.5), (1.0, 1.0, 1.0)]


@pytest.fixture(scope="module", params=TURNS, ids=str)
def turned(request):
    """The estimates of a camera that is in a quick turn from the first frame on, and its motion."""
    twist, room = np.array([0.1, 0.0, 0.0, *request.param]), PaintedRoom()
    frames = [room.rolled_frame(SMALL, k, lambda t: se3.exp(twist * t), READOUT_S) for k in range(7)]
    odometry = Odometry(SMALL, known_readout(READOUT_S))
    return [odometry.process(frame) for frame in frames], twist


def test_hardly_a_landmark_is_missed(turned):
    estimates, _ = turned
    assert min(estimate.inliers / estimate.matches for estimate in estimates[1:]) > 0.93


def test_a_second_frame_shows_the_motion_although_both_are_bent_and_nothing_is_known_of_it_before(turned):
    estimates, twist = turned
    T_first, T_second = (estimate.T_odom_camera for estimate in estimates[:2])
    off = se3.log(se3.inverse(se3.exp(twist * PERIOD * 1e-9)) @ se3.inverse(T_first) @ T_second)
    assert np.linalg.norm(off[:3]) < 0.002
    assert np.linalg.norm(off[3:]) < 0.001
