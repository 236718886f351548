"""Where a building's corridor runs: four rows of rooms with a corner behind each, round to where it began."""

import numpy as np

from odom.geometry.arrays import Array
from sensors.arena.scene_builder import pose

BAY_M = 3.2
"""Length of a room open to a corridor, metres: that of its walls and floor; shorter, its furniture overlaps."""
WIDTH_M = 3.6
"""Of the corridor with its rooms, and the side of a corner, metres: as laboratory.yaml has them."""
ROWS = 4
"""Of rooms, round the building."""
BEND_M = 1.1
"""Radius of the way round a corner, metres: smaller is sharper, larger runs into the wall."""
ASIDE_M = BEND_M - WIDTH_M / 2
"""Where the way runs in a row, metres to the furnished side: so that the bend ends where the next row begins."""
EASE_M = 1.2
"""So far before a bend the camera begins to turn, and so far behind it ends, metres: less is more sudden."""


def side_m(rooms: int) -> float:
    """Return the length of one row of rooms, metres."""
    return BAY_M * (rooms // ROWS)


def round_m(rooms: int) -> float:
    """Return the length of the way once round, metres."""
    return ROWS * (side_m(rooms) + np.pi / 2 * BEND_M)


def T_world_row(rooms: int, row: int) -> Array:
    """Return where a row begins: its first room's left end, x along the corridor, y to the furnished side."""
    T, onward = np.eye(4), pose(side_m(rooms) + WIDTH_M / 2, -WIDTH_M / 2, 0.0, -90.0)
    for _ in range(row):
        T = T @ onward
    return T


def way(rooms: int, gone_m: float) -> tuple[Array, float]:
    """Return where one is after `gone_m` of the way (x, y in the world, metres), and the heading (radians)."""
    side, bend = side_m(rooms), np.pi / 2 * BEND_M
    row, along = divmod(gone_m, side + bend)
    turn = max(0.0, along - side) / BEND_M
    here = np.array([min(along, side) + BEND_M * np.sin(turn), ASIDE_M - BEND_M * (1.0 - np.cos(turn)), 0.0, 1.0])
    turned = _eased((along - side + EASE_M) / (bend + 2 * EASE_M))
    still = 1.0 - _eased((along + bend + EASE_M) / (bend + 2 * EASE_M))
    heading = np.pi / 2 * (still - turned - row)
    return (T_world_row(rooms, int(row) % ROWS) @ here)[:2], float(heading)


def _eased(share: float) -> float:
    """Return a step from 0 to 1 that begins and ends at rest."""
    x = min(max(share, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)
