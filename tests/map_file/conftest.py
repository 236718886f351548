"""A map of a painted room, made once."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from painted_room import stroll
from walks import ROOM, shown, walk


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[np.ndarray]]:
    """The map that five seconds in a room have left, and its key frames' poses in the end (T_room_camera)."""
    path = tmp_path_factory.mktemp("map") / "room.map"
    _, odometry = walk(path, shown([stroll(k / 30.0) for k in range(150)], ROOM))
    return path, [np.array(k.T_camera_map) for k in odometry.map.keyframes]


@pytest.fixture
def room_map(made, tmp_path: Path) -> Path:
    """A copy of that map, to be changed."""
    path = tmp_path / "room.map"
    shutil.copy(made[0], path)
    return path
