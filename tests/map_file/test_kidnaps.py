"""A thousand kidnaps: a camera that wakes anywhere is found where it is or not at all, though rooms look alike.

One map holds three laboratories with the same furniture in the same places, differently painted and lit. The camera
wakes in one of them on another day (other noise and way, dimmer light, four things moved), or in one of two more that
are not in the map. Every pose given must be that of the room it is in, to 5 cm and 2 deg.
"""

import numpy as np
import pytest
from kidnaps import LAP, T_world_map, away, first_pose, map_of
from typer.testing import CliRunner

from odom.cli import app
from odom.map_file.map_file import MapFile
from sensors.arena import ArenaOptions

pytestmark = [pytest.mark.slow, pytest.mark.rendered, pytest.mark.timeout(3600)]

MAPPED, UNKNOWN = (1, 2, 3), (4, 5)
"""Seeds of the laboratories."""
STARTS = 200
"""Kidnaps in each of them: a thousand together."""
LOOKS = 6
"""Frames in which the camera may be found."""


@pytest.fixture(scope="module")
def rooms(tmp_path_factory):
    """The map of three laboratories: three parts, none joined with another."""
    folder = tmp_path_factory.mktemp("rooms")
    made = [str(map_of(folder / f"{seed}.map", ArenaOptions(seed=seed))) for seed in MAPPED]
    said = CliRunner().invoke(app, ["map", "merge", *made, "-o", str(folder / "rooms.map")], catch_exceptions=False)
    assert "0 recognitions join sessions" in said.output
    opened = MapFile(folder / "rooms.map", is_written=False)
    yield opened
    opened.close()


def starts(seed):
    return np.random.default_rng(seed).integers(0, LAP - LOOKS, STARTS).tolist()


@pytest.mark.parametrize("seed", MAPPED)
def test_it_wakes_in_a_known_room(rooms, seed):
    session, found = MAPPED.index(seed), 0
    T = T_world_map(rooms, ArenaOptions(seed=seed), session)
    segments = {k.segment for k in rooms.keyframes() if k.session == session}
    for start in starts(seed):
        estimate, truth, _ = first_pose(rooms, ArenaOptions(seed=seed, visit=1), start, LOOKS)
        if estimate is None:
            continue
        found += 1
        metres, degrees = away(estimate, truth, T)
        assert segments == {estimate.segment}, start
        assert metres < 0.05, start
        assert degrees < 2.0, start
    assert found > 0.85 * STARTS


@pytest.mark.parametrize("seed", UNKNOWN)
def test_it_wakes_in_a_room_that_only_looks_alike(rooms, seed):
    woken = [first_pose(rooms, ArenaOptions(seed=seed), start, LOOKS)[0] for start in starts(seed)]
    assert woken == [None] * STARTS
