"""Walks that several tests run the odometry over; rendered or read once a session."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn import frame
from painted_room import SMALL, PaintedRoom, stroll
from running import Ran, read_tum_frames, run

from odom.backend import OdometrySettings
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
def hanging_desk(desk) -> tuple[Camera, list[RgbdFrame], Trajectory]:
    """The same as if the camera hung upside down, and its driver turned the images: the lowest row is read first."""
    camera, frames, truth = desk
    k1, k2, p1, p2, *others = camera.distortion
    centre = {"cx": camera.width - 1 - camera.cx, "cy": camera.height - 1 - camera.cy}
    hanging = replace(camera, **centre, distortion=(k1, k2, -p1, -p2, *others))
    turned = [replace(f, color=f.color[::-1, ::-1].copy(), depth_mm=f.depth_mm[::-1, ::-1].copy()) for f in frames]
    return hanging, turned, truth


@pytest.fixture(scope="session")
def hanging_desk_ran(hanging_desk) -> Ran:
    """What came out where that was said."""
    said = OdometrySettings(readout_prior_s=-0.024, depth_readout_prior_s=-0.012)
    return run(hanging_desk[0], hanging_desk[1], said)


@pytest.fixture(scope="session")
def turning(shared_data: Path) -> tuple[Camera, list[RgbdFrame], Trajectory]:
    """A real Kinect turned fast by hand, eight seconds."""
    return read_tum_frames(shared_data / "tum_fr1_rpy_part", None)
