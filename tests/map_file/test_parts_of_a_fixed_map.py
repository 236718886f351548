"""A map of two parts that share places and were never joined: a camera that is only found in it joins them no more."""

from contextlib import closing
from dataclasses import replace

import numpy as np
from walks import HOUR, ROOM, facing, shown, walk

from odom.backend import State
from odom.backend.map.saved import SavedMap
from odom.geometry import se3
from odom.map_file.map_file import MapFile
from odom.map_file.new_map import Gathered, Origin, write_new


def in_two_parts(path):
    """The map at `path` with its newer half as a part of its own, in other coordinates."""
    new, T_new_old = path.with_name("parts.map"), se3.exp(np.array([5.0, 1.0, -2.0, 0.3, 0.5, -0.2]))
    with closing(MapFile(path, is_written=False)) as opened:
        keyframes = opened.keyframes()
        half = len(keyframes) // 2
        apart = tuple(
            replace(
                k,
                segment=1,
                first=half,
                T_camera_map=k.T_camera_map @ se3.inverse(T_new_old),
                links=tuple(n for n in k.links if n >= half),
            )
            for k in keyframes[half:]
        )
        edges = tuple(e for e in opened.edges() if (e.a < half) == (e.b < half))
        every = Gathered([Origin(opened, k.number) for k in keyframes])
        identity = opened.counts().next_identity
        parts = SavedMap((*keyframes[:half], *apart), edges, every, next_identity=identity, sensor=opened.sensor())
        write_new(new, opened.sessions(), parts)
    return new


def test_parts_of_a_map_that_is_only_read_stay_where_they_are_and_what_would_join_them_is_refused(tmp_path):
    truth = [facing(0.015 * k, k / 30.0) for k in range(120)]
    walk(tmp_path / "room.map", shown(truth, ROOM))
    path = in_two_parts(tmp_path / "room.map")
    with closing(MapFile(path, is_written=False)) as opened:
        saved = opened.keyframes()
    estimates, odometry = walk(path, shown(truth, ROOM, HOUR), localize=True)
    assert {e.state for e in estimates} == {State.TRACKING, State.RECOVERED}
    for before, now in zip(saved, odometry.map.keyframes, strict=False):
        np.testing.assert_array_equal(now.T_camera_map, before.T_camera_map)
        assert now.segment == before.segment
    refused = [loop for e in estimates for loop in e.loops if "parts of a map" in loop.reason]
    assert refused
    assert not any(loop.accepted for loop in refused)
