"""Landmarks of a saved map that were carried away stay away, also after their key frame left memory and came back."""

from types import SimpleNamespace

import numpy as np
from made_up_map import CAMERA, make

from odom.backend.map.memory import open_map, recall, set_aside, take_changes
from odom.backend.mapping.presence import note_sightings
from odom.map_file.map_file import MapFile


def test_a_landmark_that_was_carried_away_does_not_come_back_from_the_file(tmp_path):
    make(tmp_path / "a.map", 6)
    opened = MapFile(tmp_path / "a.map", is_written=True)
    map_ = open_map(opened.begin(CAMERA))
    recall(map_, [2])
    L = map_.landmarks
    gone = np.flatnonzero(L.alive & (L.keyframe == 2))[:7]
    identities = L.identity[gone].copy()
    none, all_ = np.zeros(0, dtype=np.int64), np.ones(len(gone), dtype=np.bool_)
    tracked = SimpleNamespace(
        inlier_landmarks=SimpleNamespace(rows=none),
        missed=gone,
        sight=SimpleNamespace(hidden=~all_, seen_through=all_),
        elsewhere=none,
        T_map_camera=np.eye(4),
    )
    while L.alive[gone].any():
        note_sightings(map_, tracked, 0.1, False)
    set_aside(map_, 2)
    opened.put(take_changes(map_))
    opened.flush()
    assert recall(map_, [2])
    assert not np.isin(identities, L.identity[L.alive]).any()
    assert (L.alive & (L.keyframe == 2)).any()
    opened.close()
