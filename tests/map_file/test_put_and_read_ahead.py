"""What is put is what is read from then on, whatever is read ahead meanwhile."""

from dataclasses import fields, is_dataclass, replace

import numpy as np
from backend.made_up_scene import chain_of_keyframes
from made_up_map import CAMERA, details, make

from odom.backend.map.memory import details_of
from odom.backend.map.saved import MapChanges
from odom.geometry import se3
from odom.map_file import records
from odom.map_file.arrays import pack
from odom.map_file.map_file import MapFile


def test_what_is_read_ahead_while_details_are_put_is_not_older_than_they(tmp_path, monkeypatch):
    make(tmp_path / "a.map", 5)
    opened = MapFile(tmp_path / "a.map", is_written=True)
    opened.begin(CAMERA)
    fewer = replace(details(2), identities=details(2).identities[:3])
    ahead, put = opened._ahead, opened._writer.put

    def read_ahead_before(step):
        def reading(values):
            ahead.ask([2])
            ahead._coming[2].result()
            step(values)

        return reading

    monkeypatch.setattr(ahead, "forget", read_ahead_before(ahead.forget))
    monkeypatch.setattr(opened._writer, "put", read_ahead_before(put))
    opened.put(MapChanges(details={2: fewer}))
    assert len(opened.fetch(2).identities) == 3
    opened.close()


def test_details_are_the_same_to_the_bit_before_and_after_they_are_on_disk():
    """How quickly a disk writes must change no result: what waits for it is handed out as what was written."""
    map_ = chain_of_keyframes([np.eye(4), se3.exp(np.array([0.2, 0.1, 0.0, 0.1, 0.2, 0.3]))], 1e-4 * np.eye(6))
    map_.places.adopt(map_.places.grown({1: details(1).place}))
    waiting = details_of(map_, 1)
    place = records.place_of(1, records.place_bytes(1, waiting.place))
    assert_same(waiting, records.details_of(1, records.details_bytes(1, waiting), place))


def test_landmarks_of_maps_from_before_it_was_noted_count_as_measured(monkeypatch):
    known = details(1)
    assert known.landmarks.assumed.all()
    monkeypatch.setattr(records, "pack", lambda arrays: pack({k: a for k, a in arrays.items() if "assumed" not in k}))
    assert not records.details_of(1, records.details_bytes(1, known), None).landmarks.assumed.any()


def assert_same(one, other):
    """All numbers of two values of the same dataclass are equal."""
    if is_dataclass(one):
        for field in fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name))
    else:
        np.testing.assert_array_equal(one, other)
