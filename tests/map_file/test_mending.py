"""What mending a map keeps: sessions and what was learnt of the camera; a mended map is whole, and can be extended."""

from contextlib import closing
from dataclasses import replace

import pytest
from made_up_map import CAMERA, changes, make, spoil

from odom.backend import Odometry
from odom.errors import MapError
from odom.frontend.camera.sensor_memory import SensorMemory
from odom.map_file.database import connect
from odom.map_file.map_file import MapFile
from odom.map_file.rebuild import read_all_rows, write_rest

KEYFRAMES = 5


@pytest.fixture
def path(tmp_path):
    """A map of two sessions, which says what was learnt of the camera."""
    path = tmp_path / "a.map"
    make(path, KEYFRAMES)
    opened = MapFile(path, is_written=True)
    opened.begin(CAMERA)
    last = changes(KEYFRAMES)
    sensor = SensorMemory.of(Odometry(CAMERA).sensor)
    opened.put(replace(last, keyframes=(replace(last.keyframes[0], session=1),), sensor=sensor))
    opened.close()
    return path


def damage_of(path):
    """What a check finds, and what could be read."""
    with closing(connect(path, is_written=False)) as db:
        found = read_all_rows(db)
    return found.damage, found


def mended(path):
    """A map of what is whole in another one."""
    new = path.with_name("mended.map")
    with closing(MapFile(path, is_written=False)) as opened:
        write_rest(opened, damage_of(path)[1], new)
    assert damage_of(new)[0] == []
    return new


def sensor_of(path):
    with closing(MapFile(path, is_written=False)) as opened:
        return opened.sensor()


@pytest.mark.parametrize("lost", [0, 1])
def test_a_map_that_has_lost_a_session_is_extended_as_one_of_a_new_number(path, lost):
    spoil(path, "session", f"number = {lost}")
    with closing(MapFile(mended(path), is_written=True)) as opened:
        assert [session.number for session in opened.sessions()] == [1 - lost]
        assert opened.begin(CAMERA).session == 2
        assert [session.number for session in opened.sessions()] == [1 - lost, 2]


def test_what_was_learnt_of_the_camera_stays_when_a_map_is_mended(path):
    spoil(path, "details", "number = 2")
    assert sensor_of(mended(path)).timing == sensor_of(path).timing


def test_damage_to_what_was_learnt_of_the_camera_is_told_and_mended_by_leaving_it_out(path):
    spoil(path, "meta", "name = 'sensor'")
    with pytest.raises(MapError, match="--mend"):
        MapFile(path, is_written=False).check_readable()
    assert [what for what in damage_of(path)[0] if "sensor" in what]
    assert sensor_of(mended(path)) is None
