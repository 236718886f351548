"""Walks that several tests run the odometry over; rendered or read once a session."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn import frame
from painted_room import SMALL, PaintedRoom, stroll
from running import Ran, read_tum_frames, run

from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame
from sensors.arena import ArenaFrame, ArenaOptions

ARENA_FRAMES = 105


@pytest.fixture(autouse=True, scope="session")
def _one_thread() -> None:
    cv2.setNumThreads(1)


@pytest.fixture(scope="session")
def arena() -> tuple[Camera, list[ArenaFrame]]:
    """The first seconds of the simulated walk, with all of a sensor's faults."""
    options = ArenaOptions()
    return options.camera, [frame(options, k) for k in range(ARENA_FRAMES)]


@pytest.fixture(scope="session")
def arena_truth(arena) -> Trajectory:
    return Trajectory(np.array([f.stamp for f in arena[1]]), np.array([f.T_world_camera for f in arena[1]]))


@pytest.fixture(scope="session")
def arena_ran(arena) -> Ran:
    return run(arena[0], [f.rgbd() for f in arena[1]])


@pytest.fixture(scope="session")
def room_frames() -> list[RgbdFrame]:
    """Two seconds in a painted room, perfect small images."""
    room = PaintedRoom()
    return [room.frame(SMALL, k, stroll(k / 30.0)) for k in range(60)]


@pytest.fixture(scope="session")
def room_ran(room_frames) -> Ran:
    return run(SMALL, room_frames)


@pytest.fixture(scope="session")
def desk(shared_data: Path) -> tuple[Camera, list[RgbdFrame], Trajectory]:
    """The first five seconds of a real Kinect at a desk."""
    return read_tum_frames(shared_data / "tum_fr1_xyz", 150)


@pytest.fixture(scope="session")
def desk_ran(desk) -> Ran:
    return run(desk[0], desk[1])


@pytest.fixture(scope="session")
def turning(shared_data: Path) -> tuple[Camera, list[RgbdFrame], Trajectory]:
    """A real Kinect turned fast by hand, eight seconds."""
    return read_tum_frames(shared_data / "tum_fr1_rpy_part", None)
