"""Another visit: the same room, seen with other noise, from another way and in other light; some things have moved."""

import numpy as np
from drawn import frame

from sensors.arena import ArenaOptions
from sensors.arena.camera_path import make_walk
from sensors.arena.frames import depth_time


def test_the_room_is_the_same_but_for_some_things():
    first, later = (frame(ArenaOptions(visit=visit, walk="rest", faults=False), 0) for visit in (0, 1))
    assert not np.allclose(first.T_world_camera, later.T_world_camera)
    assert abs(float(np.median(later.rgbd().depth_mm)) / float(np.median(first.rgbd().depth_mm)) - 1.0) < 0.5


def test_noise_and_way_are_its_own():
    first, later, again = (ArenaOptions(visit=visit) for visit in (0, 1, 1))
    assert depth_time(first, 5) != depth_time(later, 5)
    assert depth_time(again, 5) == depth_time(later, 5)
    ways = [make_walk(options).T_world_camera(1.0) for options in (first, later)]
    assert np.linalg.norm(ways[0][:3, 3] - ways[1][:3, 3]) > 0.05
