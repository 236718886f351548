"""What a session has learnt of the tilt of depth is known in the next one, in the map that was made with it."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import SMALL, stroll, tilted
from walks import HOUR, ROOM, away, shown, walk

from odom.backend import State
from odom.frontend.camera.depth_tilt import DepthTilt
from odom.map_file.arrays import pack, unpack
from odom.map_file.map_file import MapFile
from odom.map_file.records import sensor_bytes, sensor_of

TILT = np.array([0.03, -0.02])


def walked(path, poses, first=0, localize=False):
    """Walk with a map as a camera does whose depth has a tilt."""
    return walk(path, [tilted(frame, TILT) for frame in shown(poses, ROOM, first)], localize)


@pytest.mark.long
def test_a_camera_of_tilted_depth_is_found_in_its_map_as_exactly_as_it_was_made(tmp_path):
    path = tmp_path / "room.map"
    _, made = walked(path, [stroll(k / 30.0) for k in range(120)])
    truth = [stroll(1.0 + k / 30.0) for k in range(12)]
    estimates, again = walked(path, truth, HOUR, localize=True)
    assert made.sensor.depth_tilt.is_shown
    np.testing.assert_array_equal(again.sensor.depth_tilt.angles, made.sensor.depth_tilt.angles)
    assert [e.state for e in estimates[:2]] == [State.RECOVERED, State.TRACKING]
    for estimate, T in zip(estimates, truth, strict=True):
        assert away(stroll(0.0) @ estimate.T_odom_camera, T)[0] < 0.006


def test_a_map_without_a_word_of_tilt_is_of_a_camera_without_one(made):
    opened = MapFile(made[0], is_written=False)
    remembered = opened.begin(SMALL).sensor
    opened.close()
    row = sensor_bytes(replace(remembered, depth_tilt=DepthTilt(TILT, np.eye(2), np.ones(2), is_shown=True)))
    known = sensor_of(row).depth_tilt
    assert known.is_shown
    np.testing.assert_array_equal(known.angles, TILT)
    np.testing.assert_array_equal(known.evidence, 1.0)
    older = pack({name: values for name, values in unpack(row).items() if "tilt" not in name})
    assert not sensor_of(older).depth_tilt.is_shown
    np.testing.assert_array_equal(sensor_of(older).timing.vector, remembered.timing.vector)
