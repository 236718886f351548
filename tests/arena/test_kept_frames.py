"""Frames that other tests take from the disk are those that the simulator draws."""

from pathlib import Path

import drawn
import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom, stroll

from odom.frame import Camera
from sensors.arena import ArenaOptions, frame


@pytest.fixture
def kept_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(drawn.ENVIRONMENT, str(tmp_path))
    (tmp_path / "drawn-by-other-sources").mkdir()
    (tmp_path / "somebody's own").mkdir()
    drawn._folder.cache_clear()
    yield tmp_path
    drawn._folder.cache_clear()


def test_a_kept_frame_is_the_drawn_one_and_is_drawn_once(kept_here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = ArenaOptions(half=True)
    true = frame(options, 7)
    first = drawn.frame(options, 7)
    monkeypatch.setattr("sensors.arena.frame", None)  # whoever draws now fails
    for shot in (first, drawn.frame(options, 7)):
        assert (shot.index, shot.stamp, shot.depth_stamp) == (true.index, true.stamp, true.depth_stamp)
        assert (type(shot.stamp), shot.rgb.dtype, shot.depth_mm.dtype) == (int, np.uint8, np.uint16)
        for name in ("rgb", "depth_mm", "T_world_camera"):
            np.testing.assert_array_equal(getattr(shot, name), getattr(true, name))
    assert not (kept_here / "drawn-by-other-sources").exists()
    assert (kept_here / "somebody's own").exists()


def test_an_empty_name_of_the_folder_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(drawn.ENVIRONMENT, "")
    (tmp_path / "drawn-by-other-sources").mkdir()
    drawn._folder.cache_clear()
    assert drawn._folder() is None
    assert [path.name for path in tmp_path.iterdir()] == ["drawn-by-other-sources"]
    drawn._folder.cache_clear()


def test_a_kept_view_of_the_painted_room_is_the_drawn_one(kept_here: Path) -> None:
    room, T = PaintedRoom(3), stroll(0.5)
    grey, depth_mm = room._draw(SMALL, [T])
    for _ in range(2):
        seen = room.render(SMALL, T)
        np.testing.assert_array_equal(seen[0], grey)
        np.testing.assert_array_equal(seen[1], depth_mm)
        assert (seen[0].dtype, seen[1].dtype) == (np.uint8, np.uint16)
    assert len(list(kept_here.rglob("*.npz"))) == 1


def test_no_more_is_kept_than_there_is_room_for(kept_here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawn, "MOST_BYTES", 100_000)
    for k in range(10):
        PaintedRoom().render(SMALL, stroll(0.1 * k))
    assert 0 < sum(file.stat().st_size for file in kept_here.rglob("*")) < 300_000


def test_a_wall_is_seen_along_the_axis_of_a_camera_that_stands_straight_before_it() -> None:
    camera = Camera(320, 240, 262.5, 262.5, 160.0, 120.0)  # the ray of the middle pixel is exactly 0, 0
    _, depth_mm = PaintedRoom().render(camera, np.eye(4))
    assert (depth_mm[119:122, 159:162] == 2000).all()
