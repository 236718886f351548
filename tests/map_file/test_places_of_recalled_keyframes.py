"""The place that a key frame shows is known as long as that is: whether it is in memory, waits or is saved."""

import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from backend.made_up_scene import blank_view
from made_up_map import CAMERA, changes, details, make

from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.map.memory import open_map, recall, set_aside, take_changes
from odom.backend.map.saved import MapChanges
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.map_file import writer
from odom.map_file.map_file import MapFile


@pytest.fixture
def opened(tmp_path):
    make(tmp_path / "a.map", 4)
    file = MapFile(tmp_path / "a.map", is_written=True)
    yield file
    file.close()


@pytest.fixture
def gate(opened, monkeypatch):
    """A gate before the disk, open at first and in the end; `reached` when something comes to it."""
    reached, gate, write = threading.Event(), threading.Event(), writer.write
    monkeypatch.setattr(writer, "write", lambda *values: (reached.set(), gate.wait(), write(*values)))
    gate.set()
    yield SimpleNamespace(reached=reached, open=gate.set, close=gate.clear)
    gate.set()


def map_with_a_new_keyframe(opened):
    """The map, and the number of a new key frame in it whose place was described just now."""
    map_ = open_map(opened.begin(CAMERA))
    recall(map_, [3])
    T, nothing = map_.keyframes[3].T_camera_map, MeasuredLandmarks.nothing()
    number = map_.add_keyframe(blank_view(100), T, nothing, ShutterTiming(), 3, 1e-4 * np.eye(6)).number
    map_.places.adopt(map_.places.grown({number: details(50).place}))
    map_.journal.note_new_details([number])
    return map_, number


def is_known(place):
    return place is not None and np.array_equal(place.descriptors, details(50).place.descriptors)


def test_a_place_that_is_saved_is_known_while_newer_details_of_its_key_frame_wait(opened, gate):
    map_, number = map_with_a_new_keyframe(opened)
    opened.put(take_changes(map_))
    opened.flush()
    set_aside(map_, number)
    recall(map_, [number])
    map_.journal.note_new_details([number])
    gate.close()
    opened.put(take_changes(map_))
    assert is_known(map_.places.place_of(number))
    gate.open()
    opened.flush()
    assert is_known(map_.places.place_of(number))


def test_a_place_is_known_when_its_key_frame_leaves_memory_before_it_is_saved(opened):
    map_, number = map_with_a_new_keyframe(opened)
    set_aside(map_, number)
    assert is_known(map_.places.place_of(number))
    recall(map_, [number])
    assert is_known(map_.places.place_of(number))
    opened.put(take_changes(map_))
    opened.flush()
    assert is_known(opened.fetch_place(number))


def test_what_is_saved_leaves_memory_with_its_key_frame(opened):
    map_, number = map_with_a_new_keyframe(opened)
    set_aside(map_, number)
    opened.put(take_changes(map_))
    assert number not in map_.places.places
    assert is_known(map_.places.place_of(number))
    recall(map_, [number])
    set_aside(map_, number)
    assert number not in map_.places.places


def test_a_search_knows_the_places_that_were_in_memory_when_it_began(opened):
    map_, number = map_with_a_new_keyframe(opened)
    set_aside(map_, number)
    searched = map_.places.snapshot()
    taken = take_changes(map_)  # not on its way to disk yet
    assert is_known(searched.place_of(number))
    opened.put(taken)
    assert np.array_equal(searched.place_of(number).points, details(50).place.points)


def test_newer_details_without_a_place_do_not_cost_the_one_that_waits(opened, gate):
    opened.begin(CAMERA)
    gate.close()
    opened.put(changes(4))
    gate.reached.wait()
    for place in (details(50).place, None):
        opened.put(MapChanges(details={4: replace(details(4), place=place)}))
    assert is_known(opened.fetch_place(4))
    gate.open()
    opened.flush()
    assert is_known(opened.fetch_place(4))
