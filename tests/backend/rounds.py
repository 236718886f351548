"""A camera that turns round and round in a painted room."""

from dataclasses import replace

import numpy as np
from painted_room import PERIOD, SMALL, START, PaintedRoom

from odom.frame import RgbdFrame, Stamp
from odom.geometry import se3

ROUND = 160


def turned(k: int) -> np.ndarray:
    """T_room_camera on a circle about the middle of the room."""
    angle = 2.0 * np.pi * k / ROUND
    T = np.eye(4)
    T[:3, :3] = se3.so3_exp(np.array([0.0, angle, 0.0]))
    T[:3, 3] = T[:3, :3] @ [0.0, 0.1 * np.sin(3.0 * angle), 0.4]
    return T


def round_and_more(count: int) -> list[RgbdFrame]:
    """The first `count` frames."""
    room = PaintedRoom(half_size=(2.2, 1.2, 2.2))
    once = [room.frame(SMALL, k, turned(k)) for k in range(min(count, ROUND))]
    stamps = [Stamp(START + k * PERIOD) for k in range(count)]
    return [replace(once[k % ROUND], sequence=k, stamp=s, depth_stamp=s) for k, s in enumerate(stamps)]
