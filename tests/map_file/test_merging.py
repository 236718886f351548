"""Maps of several days become one: the same bytes in any order, one part where they share places, told where not."""

import itertools
import shutil
from dataclasses import replace

import made_up_map
import numpy as np
import pytest
from painted_room import PaintedRoom, stroll
from typer.testing import CliRunner
from walks import HOUR, ROOM, away, rolled, shown, walk

from odom.backend import State
from odom.cli import app
from odom.errors import ConfigError, MapError
from odom.geometry import se3
from odom.map_file.map_file import MapFile

ORDER = ("third", "first", "second")
"""In which `room` is made of the maps of three days."""


def merged(*files, out):
    return CliRunner().invoke(app, ["map", "merge", *map(str, files), "-o", str(out)], catch_exceptions=False)


def opened(path):
    return MapFile(path, is_written=False)


@pytest.fixture(scope="module")
def days(made, tmp_path_factory):
    """Two more maps of the room, begun elsewhere and on another day, and one of another room."""
    folder = tmp_path_factory.mktemp("days")
    walk(folder / "second.map", shown([rolled(stroll(3.0 + k / 30.0), 20.0) for k in range(120)], ROOM, HOUR))
    walk(folder / "third.map", shown([stroll(6.0 + k / 30.0) for k in range(90)], ROOM, 2 * HOUR))
    walk(folder / "other.map", shown([stroll(k / 30.0) for k in range(90)], PaintedRoom(7), 3 * HOUR))
    shutil.copy(made[0], folder / "first.map")
    return folder


@pytest.fixture(scope="module")
def room(days):
    """The three maps of the room as one, and what was said of it."""
    said = merged(*(days / f"{name}.map" for name in ORDER), out=days / "room.map")
    return days / "room.map", said.output


def test_any_order_gives_the_same_bytes(days, room, tmp_path):
    others = set(itertools.permutations(ORDER)) - {ORDER}
    assert len(others) == 5
    for number, order in enumerate(sorted(others)):
        merged(*(days / f"{name}.map" for name in order), out=tmp_path / f"{number}.map")
        assert (tmp_path / f"{number}.map").read_bytes() == room[0].read_bytes()


def test_sessions_are_joined_where_they_were(days, room):
    one = opened(room[0])
    keyframes, sessions = one.keyframes(), one.sessions()
    assert [s.number for s in sessions] == [0, 1, 2]
    assert {k.segment for k in keyframes} == {0}
    assert "part 1" not in room[1]
    before = [k for name in ("first", "second", "third") for k in opened(days / f"{name}.map").keyframes()]
    assert sorted(k.stamp for k in keyframes) == sorted(k.stamp for k in before)
    for k in keyframes:
        t = (k.stamp - keyframes[0].stamp) * 1e-9
        session = int(t // 3000.0)
        truth = (stroll(t), rolled(stroll(t - 3600.0 + 3.0), 20.0), stroll(t - 7200.0 + 6.0))[session]
        assert away(stroll(0.0) @ se3.inverse(k.T_camera_map), truth)[0] < 0.006
    one.close()


def test_landmarks_and_key_frames_stay_told_apart(days, room):
    one = opened(room[0])
    details = [one.fetch(k.number) for k in one.keyframes()]
    own = np.concatenate([d.landmarks.identity for d in details])
    assert len(np.unique(own)) == len(own)
    assert own.max() < one.counts().next_identity
    each = [opened(days / f"{name}.map") for name in ("first", "second", "third")]
    assert len(details) == sum(len(map_.keyframes()) for map_ in each)
    seen = [np.isin(map_.fetch(k.number).identities, 0) for map_ in each for k in map_.keyframes()]
    assert sum(n.sum() for n in seen) == sum((d.identities == 0).sum() for d in details)
    assert CliRunner().invoke(app, ["map", "check", str(room[0])]).exit_code == 0


def test_a_camera_is_found_in_what_either_session_saw(room, tmp_path):
    path = shutil.copy(room[0], tmp_path / "room.map")
    for start in (0.5, 5.0, 8.0):
        truth = [rolled(stroll(start + k / 30.0), 180.0) for k in range(6)]
        estimates, _ = walk(path, shown(truth, ROOM, 9 * HOUR), localize=True)
        assert [e.state for e in estimates[:2]] == [State.RECOVERED, State.TRACKING]
        assert all(away(stroll(0.0) @ e.T_odom_camera, T)[0] < 0.01 for e, T in zip(estimates, truth, strict=True))


def test_a_session_goes_on_in_a_merged_map(room, tmp_path):
    path = shutil.copy(room[0], tmp_path / "room.map")
    estimates, odometry = walk(path, shown([stroll(9.0 + k / 30.0) for k in range(40)], ROOM, 9 * HOUR))
    assert estimates[0].state is State.RECOVERED
    assert {k.session for k in odometry.map.keyframes} >= {0, 1, 2}
    one = opened(path)
    assert len(one.sessions()) == 4
    one.close()


def test_maps_that_share_no_place_stay_side_by_side(days, tmp_path):
    said = merged(days / "other.map", days / "first.map", out=tmp_path / "both.map").output
    assert "2 parts share no place" in said
    assert "0 recognitions join" in said
    both, first = opened(tmp_path / "both.map"), opened(days / "first.map")
    assert {(k.session, k.segment) for k in both.keyframes()} == {(0, 0), (1, 1)}
    for k, was in zip(both.keyframes(), first.keyframes(), strict=False):
        np.testing.assert_array_equal(k.T_camera_map, was.T_camera_map)


def test_a_third_map_joins_parts_that_share_nothing_themselves(days, tmp_path):
    merged(days / "first.map", days / "other.map", out=tmp_path / "apart.map")
    said = merged(tmp_path / "apart.map", days / "second.map", out=tmp_path / "joined.map").output
    assert "part 0: " in said
    assert "of session 0, 2" in said
    assert "2 parts share no place" in said


def test_what_cannot_be_merged_is_refused_and_nothing_is_left(days, tmp_path):
    first, out = days / "first.map", tmp_path / "out.map"
    made_up_map.make(tmp_path / "wide.map", 3)
    narrow = MapFile(tmp_path / "narrow.map", is_written=True)
    narrow.begin(replace(made_up_map.CAMERA, fx=540.0))
    narrow.put(made_up_map.changes(0))
    narrow.close()
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    with pytest.raises(ConfigError, match="different cameras"):
        merged(tmp_path / "wide.map", tmp_path / "narrow.map", out=out)
    with pytest.raises(MapError, match="the same key frames"):
        merged(first, days / "second.map", shutil.copy(first, days / "copy.map"), out=out)
    with pytest.raises(ConfigError, match="two or more"):
        merged(first, out=out)
    with pytest.raises(ConfigError, match="is there already"):
        merged(first, days / "second.map", out=tmp_path / "wide.map")
    with pytest.raises(ConfigError, match="there is no map"):
        merged(first, tmp_path / "none.map", out=out)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_a_damaged_map_is_not_merged(days, tmp_path):
    content = bytearray((days / "first.map").read_bytes())
    for at in range(len(content) // 3, len(content), 40_000):
        content[at] ^= 0xFF
    (tmp_path / "hurt.map").write_bytes(content)
    with pytest.raises(MapError, match="--mend"):
        merged(tmp_path / "hurt.map", days / "second.map", out=tmp_path / "out.map")
    assert [p.name for p in tmp_path.iterdir()] == ["hurt.map"]


def test_the_newest_session_says_what_is_known_of_the_camera(days, room):
    one, third = opened(room[0]), opened(days / "third.map")
    kept, learnt = one.sensor(), third.sensor()
    np.testing.assert_array_equal(kept.timing.vector, learnt.timing.vector)
    assert kept.noise.pixel_sigma == learnt.noise.pixel_sigma
