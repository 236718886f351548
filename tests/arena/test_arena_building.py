"""The building: a way that comes back to where it began, past rooms of different and of look-alike kinds."""

import itertools

import numpy as np
import pytest

from odom.errors import ConfigError
from odom.geometry import se3
from sensors.arena import ArenaOptions, frame
from sensors.arena import frames as session
from sensors.arena.building import ALIKE_ROW, Building, building
from sensors.arena.camera_path import make_walk
from sensors.arena.options import RATE_HZ, WALKING_M_S
from sensors.arena.ring import BAY_M, ROWS, round_m, side_m, way

SMALL = ArenaOptions(rooms=8, half=True)


@pytest.fixture(scope="module")
def eight_rooms() -> Building:
    """The building that the frames of SMALL are drawn of: to furnish and light one takes seconds."""
    return session._building(SMALL.seed, SMALL.rooms, False)


@pytest.mark.parametrize("rooms", [4, 20, 92])
def test_the_way_comes_back_to_where_it_began_without_a_jump(rooms: int) -> None:
    steps = np.linspace(0.0, round_m(rooms), 4001)
    places = np.array([way(rooms, s)[0] for s in steps])
    headings = np.array([way(rooms, s)[1] for s in steps])
    assert np.linalg.norm(places[-1] - places[0]) < 1e-9
    assert headings[-1] - headings[0] == pytest.approx(-2 * np.pi)
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 1.001 * steps[1]
    assert np.abs(np.diff(headings)).max() < 1.2 * steps[1]


def test_it_is_carried_by_hand() -> None:
    walk = make_walk(ArenaOptions(rooms=92))
    T = [walk.T_world_camera(k / RATE_HZ) for k in range(2400, 5400)]
    steps = [se3.log(se3.inverse(a) @ b) * RATE_HZ for a, b in itertools.pairwise(T)]
    assert np.median([np.linalg.norm(s[:3]) for s in steps]) == pytest.approx(WALKING_M_S, rel=0.1)
    assert np.degrees(max(np.linalg.norm(s[3:]) for s in steps)) < 60


def test_92_rooms_are_three_hundred_metres() -> None:
    assert round_m(92) > 300
    assert ArenaOptions(rooms=92).frames / RATE_HZ * WALKING_M_S > round_m(92) + 10


@pytest.mark.long
def test_rooms_of_one_row_are_alike_to_the_last_book_and_others_are_not(eight_rooms: Building) -> None:
    sections = eight_rooms.sections
    in_row = 8 // ROWS + 1  # and a corner
    one, next_, other = sections[ALIKE_ROW * in_row], sections[ALIKE_ROW * in_row + 1], sections[0]
    assert np.array_equal(one.patch, next_.patch)
    assert not np.array_equal(other.patch, sections[1].patch)
    apart = next_.origin - one.origin
    assert np.allclose(apart, apart[0])
    assert np.linalg.norm(apart[0]) == pytest.approx(BAY_M)


@pytest.mark.long
def test_a_frame_is_the_same_in_whatever_order_it_is_asked_for_and_another_visit_shows_another_light(
    eight_rooms: Building,
) -> None:
    there = frame(SMALL, 300)
    frame(SMALL, 900)
    again = frame(SMALL, 300)
    assert np.array_equal(there.rgb, again.rgb)
    assert np.array_equal(there.depth_mm, again.depth_mm)
    first, later = eight_rooms, building(SMALL.seed, SMALL.rooms, is_later=True)
    assert later.atlas.texels.shape == first.atlas.texels.shape
    bright, dim = (np.mean(b.atlas.texels & 0xFF) for b in (first, later))
    assert dim < 0.97 * bright  # half of the light is that of the surroundings
    assert any(not np.allclose(a.origin, b.origin) for a, b in zip(first.sections, later.sections, strict=True))


@pytest.mark.long
def test_everything_is_seen_from_within() -> None:
    for index in range(0, SMALL.frames, 97):
        depth = frame(SMALL, index).depth_mm
        assert np.mean(depth > 0) > 0.5
    assert side_m(8) == 2 * BAY_M


@pytest.mark.parametrize("texts", [{"rooms": "6"}, {"rooms": "8", "people": "1"}, {"rooms": "8", "walk": "rest"}])
def test_what_does_not_fit_a_building_is_refused(texts: dict[str, str]) -> None:
    with pytest.raises(ConfigError, match="rooms"):
        ArenaOptions.from_texts(texts)
