"""Walks through a painted room with a map on disk."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from painted_room import PERIOD, SMALL, PaintedRoom, stroll

from odom.backend import Estimate, Odometry, OdometrySettings
from odom.frame import RgbdFrame
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.map_file.map_file import MapFile

ROOM = PaintedRoom()
HOUR = 3600 * 1_000_000_000 // PERIOD
"""Frames between two sessions."""


def shown(poses: Iterable[Array], room: PaintedRoom, first: int = 0) -> list[RgbdFrame]:
    """Frames of a camera at `poses` (T_room_camera), every period, from number `first` on."""
    return [room.frame(SMALL, first + k, T) for k, T in enumerate(poses)]


def facing(angle: float, t: float) -> Array:
    """The pose at time `t` of a stroll, turned to the right by an angle."""
    T = stroll(t)
    T[:3, :3] = se3.so3_exp(np.array([0.0, angle, 0.0])) @ T[:3, :3]
    return T


def rolled(T: Array, degrees: float) -> Array:
    """The pose of a camera turned round its axis of sight."""
    out = T.copy()
    out[:3, :3] = T[:3, :3] @ se3.so3_exp(np.array([0.0, 0.0, np.deg2rad(degrees)]))
    return out


def walk(
    path: Path, frames: Iterable[RgbdFrame], localize: bool = False, settings: OdometrySettings | None = None
) -> tuple[list[Estimate], Odometry]:
    """Run a session in the map at `path` to its end, written every ten frames."""
    opened = MapFile(path, is_written=not localize)
    odometry = Odometry(SMALL, settings, opened.begin(SMALL))
    estimates = []
    for k, frame in enumerate(frames):
        estimates.append(odometry.process(frame))
        if k % 10 == 9:
            opened.put(odometry.take_map_changes())
    odometry.finish()
    opened.put(odometry.take_map_changes())
    opened.flush()
    assert opened.unwritten == 0
    opened.close()
    return estimates, odometry


def away(T: Array, T_truth: Array) -> tuple[float, float]:
    """How far two poses are apart, in metres and radians."""
    xi = se3.log(se3.inverse(T_truth) @ T)
    return float(np.linalg.norm(xi[:3])), float(np.linalg.norm(xi[3:]))
