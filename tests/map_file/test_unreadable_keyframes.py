"""Key frames of a map that a failing disk has damaged: the rest is brought back, and a camera is found by it."""

import numpy as np
import pytest
from made_up_map import CAMERA, Counting, make, spoil
from painted_room import stroll
from walks import HOUR, ROOM, shown, walk

from odom.backend import State
from odom.backend.map.memory import open_map, recall_near
from odom.map_file.map_file import MapFile

NEAR = 10
AT_ONCE = 2


@pytest.fixture
def opened(tmp_path):
    """A map with two key frames side by side that cannot be read."""
    make(tmp_path / "a.map", 30)
    for number in (NEAR, NEAR + 1):
        spoil(tmp_path / "a.map", "details", f"number = {number}")
    file = MapFile(tmp_path / "a.map", is_written=False)
    yield file
    file.close()


def test_those_that_cannot_be_read_do_not_keep_others_away_and_are_read_and_counted_once(opened):
    map_ = open_map(opened.begin(CAMERA))
    map_.details = counting = Counting(opened)
    for _ in range(20):
        recall_near(map_, NEAR, map_.keyframes[NEAR].T_camera_map, AT_ONCE)
    around = map_.around(NEAR, 12)
    assert set(map_.remembered) == around - {NEAR, NEAR + 1}
    assert sorted(counting.fetched) == sorted(around)
    for number in (NEAR, NEAR + 1):
        opened.fetch(number)
    assert opened.lost == 2


def test_as_many_come_back_at_once_as_there_is_room_for_also_where_the_camera_is_at_one_of_them(opened):
    map_ = open_map(opened.begin(CAMERA))
    recall_near(map_, 20, map_.keyframes[20].T_camera_map, AT_ONCE)
    assert len(map_.remembered) == AT_ONCE


def test_a_place_of_which_nothing_can_be_read_has_no_neighbours(tmp_path):
    make(tmp_path / "b.map", 3)
    for number in range(3):
        spoil(tmp_path / "b.map", "details", f"number = {number}")
    opened = MapFile(tmp_path / "b.map", is_written=False)
    map_ = open_map(opened.begin(CAMERA))
    recall_near(map_, 1, map_.keyframes[1].T_camera_map)
    assert map_.remembered == []
    assert map_.neighbours(1, np.eye(4), 10).tolist() == []
    opened.close()


@pytest.mark.parametrize("localize", [True, False])
def test_at_places_of_which_nothing_can_be_read_a_camera_is_not_found_and_maps_them_anew(room_map, made, localize):
    for number in range(len(made[1])):
        spoil(room_map, "details", f"number = {number}")
    estimates, _ = walk(room_map, shown([stroll(k / 30.0) for k in range(40)], ROOM, HOUR), localize)
    assert {e.state for e in estimates} == {State.LOST if localize else State.TRACKING}
    refusals = {loop.reason for e in estimates for loop in e.loops}
    assert localize or "what was saved of it cannot be read" in refusals
