"""A map without key frames, as a run leaves it that ended before its first one: extended, but no camera is found."""

import pytest
from made_up_map import CAMERA, changes, make
from refused import refusal

from odom.backend import Odometry
from odom.map_file.map_file import MapFile


@pytest.fixture
def empty(tmp_path):
    make(tmp_path / "empty.map", 0)
    return tmp_path / "empty.map"


def test_a_map_without_key_frames_is_opened_for_finding_the_camera_and_holds_nothing(empty):
    opened = MapFile(empty, is_written=False)
    assert Odometry(CAMERA, saved=opened.begin(CAMERA)).map.keyframes == []
    opened.close()


def test_finding_a_camera_in_a_map_without_key_frames_is_refused_with_what_to_do(empty, tmp_path):
    said = refusal("run", "arena", "--headless", "--out", tmp_path / "out", "--map", empty, "--localize")
    assert "holds no key frame" in said
    assert "without --localize" in said


def test_a_map_without_key_frames_is_extended(empty):
    opened = MapFile(empty, is_written=True)
    opened.begin(CAMERA)
    opened.put(changes(0))
    opened.close()
    opened = MapFile(empty, is_written=False)
    assert len(opened.keyframes()) == 1
    opened.close()
