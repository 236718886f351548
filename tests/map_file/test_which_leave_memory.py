"""Which key frames of a saved map leave memory: the farthest, so that what is near stays and nothing is read twice."""

from types import SimpleNamespace

import numpy as np
import pytest
from backend.made_up_scene import blank_view
from made_up_map import CAMERA, Counting, make

from odom.backend import Odometry, OdometrySettings
from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.map.memory import open_map, recall
from odom.backend.mapping.mapper import Mapper
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.map_file.map_file import MapFile

SAVED, MOST = 60, 30


@pytest.fixture(params=[False, True], ids=["extended", "fixed"])
def opened(request, tmp_path):
    make(tmp_path / "a.map", SAVED)
    file = MapFile(tmp_path / "a.map", is_written=not request.param)
    yield file
    file.close()


def map_of(opened):
    """The map, each of its key frames linked with four on either side."""
    map_ = open_map(opened.begin(CAMERA))
    for a in range(SAVED):
        for b in range(a + 1, min(a + 5, SAVED)):
            map_.link(a, b)
    return map_, Mapper(map_, OdometrySettings(map_keyframes=MOST), Odometry(CAMERA).sensor)


def at(map_, number):
    return SimpleNamespace(reference=number, T_camera_map=map_.keyframes[number].T_camera_map)


def test_a_camera_that_rests_has_the_key_frames_around_it_in_memory_and_reads_nothing(opened):
    map_, mapper = map_of(opened)
    recall(map_, range(25, 55))
    for number in range(40, 11, -1):
        for _ in range(6):
            mapper.prune(at(map_, number))
            mapper.recall(at(map_, number))
    map_.details = counting = Counting(opened)
    for _ in range(10):
        mapper.prune(at(map_, 12))
        mapper.recall(at(map_, 12))
    assert counting.fetched == []
    assert map_.away.isdisjoint(map_.nearest(list(range(SAVED)), at(map_, 12).T_camera_map)[:12].tolist())


def test_of_those_made_since_none_is_forgotten_while_saved_ones_can_be_set_aside(opened):
    map_, mapper = map_of(opened)
    recall(map_, range(25))
    for k in range(MOST // 2):
        T, nothing = map_.keyframes[0].T_camera_map, MeasuredLandmarks.nothing()
        map_.add_keyframe(blank_view(100 + k), T, nothing, ShutterTiming(), SAVED + k - 1 if k else 0, 1e-4 * np.eye(6))
    mapper.prune(at(map_, SAVED))
    assert len(map_.remembered) == MOST
    assert map_.forgotten == []
    assert not [n for n in map_.away if n >= SAVED and not map_.journal.is_kept]
    if map_.is_fixed:
        for k in range(MOST):
            T, nothing = map_.keyframes[0].T_camera_map, MeasuredLandmarks.nothing()
            newest = len(map_.keyframes) - 1
            map_.add_keyframe(blank_view(200 + k), T, nothing, ShutterTiming(), newest, 1e-4 * np.eye(6))
        assert mapper.prune(at(map_, newest))
        assert len(map_.remembered) <= MOST
        assert SAVED in map_.forgotten
