"""Which part of a view moves."""

import numpy as np
from painted_room import PERIOD, SMALL, START, PaintedRoom, anchor_before_camera, stroll
from sensor_models import sensor_model, view_of

from odom.evaluation.painter import Painter
from odom.evaluation.passers_by import passers_by
from odom.frame import RgbdFrame
from odom.frontend.camera.lens import Lens
from odom.frontend.matching.look_back import EarlierView
from odom.frontend.matching.moving_surfaces import DepthGrid, MovingCells, moving_cells
from odom.geometry import se3

SENSOR, AT_REST, HERE = sensor_model(SMALL), np.zeros(6), np.eye(4)
ROOM = PaintedRoom()


def moved(now: RgbdFrame, earlier: RgbdFrame, T_earlier_now=HERE) -> MovingCells:
    grid = DepthGrid.of(view_of(now), SENSOR, AT_REST)
    return moving_cells(grid, [EarlierView(view_of(earlier), T_earlier_now, AT_REST)], SENSOR)


def shares(cells: MovingCells, mask) -> np.ndarray:
    """The share of each cell (rows x columns) that a mask of the image covers."""
    rows, columns = cells.mask.shape
    height, width = mask.shape
    mask = mask[: height // rows * rows, : width // columns * columns]
    return mask.reshape(rows, mask.shape[0] // rows, columns, -1).mean(axis=(1, 3))


def test_in_a_room_at_rest_nothing_moves_while_the_camera_walks() -> None:
    T_room_now, T_room_earlier = stroll(1.4), stroll(1.0)
    frames = [ROOM.frame(SMALL, number, T) for number, T in ((42, T_room_now), (30, T_room_earlier))]
    assert moved(*frames, se3.inverse(T_room_earlier) @ T_room_now).share < 0.02


def test_a_body_moves_as_a_whole_and_the_room_behind_it_does_not() -> None:
    painter = Painter(SMALL, passers_by(SMALL, 0.9, share=0.4), START, anchor_before_camera, Lens.of(SMALL))
    (now, mask), (earlier, _) = (painter.paint(ROOM.frame(SMALL, number, np.eye(4))) for number in (74, 62))
    cells = moved(now, earlier)
    covered = shares(cells, mask)
    assert (covered > 0.9).sum() >= 6
    assert cells.mask[covered > 0.9].mean() > 0.7
    assert cells.mask[covered < 0.1].mean() < 0.05


def test_what_was_uncovered_does_not_move() -> None:
    wall = ROOM.frame(SMALL, 0, np.eye(4))
    hidden = wall.depth_mm.copy()
    hidden[:, :80] = 600
    before = RgbdFrame(1, START + PERIOD, wall.color, START + PERIOD, hidden)
    assert moved(wall, before).share == 0.0


def test_places_are_looked_up_in_cells_up_to_the_images_border() -> None:
    cells = MovingCells(np.array([[True, False], [False, False]]), 0.25, (100, 200))
    uv = np.array([[0.0, 0.0], [99.9, 49.9], [100.0, 50.0], [199.0, 99.0], [-1.0, -1.0], [250.0, 10.0]])
    assert cells.at(uv).tolist() == [True, True, False, False, True, False]


def test_without_depth_nothing_is_said_to_move() -> None:
    wall = ROOM.frame(SMALL, 0, np.eye(4))
    blind = RgbdFrame(1, START + PERIOD, wall.color, START + PERIOD, np.zeros_like(wall.depth_mm))
    assert moved(wall, blind).share == 0.0
    assert moved(blind, wall).share == 0.0
