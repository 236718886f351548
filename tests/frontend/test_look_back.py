"""Corners looked for in an earlier view: what stood still, what moved, and what could not be seen."""

import numpy as np
from painted_room import PERIOD, SMALL, START, PaintedRoom, anchor_before_camera, stroll
from sensor_models import sensor_model, view_of

from odom.evaluation.painter import Painter
from odom.evaluation.passers_by import passers_by
from odom.frame import RgbdFrame
from odom.frontend.camera.lens import Lens
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.image_scale import own_uv
from odom.frontend.features.measurement import measure
from odom.frontend.matching.look_back import CornerPatches, EarlierView, Sighting, look_back
from odom.geometry import se3
from odom.geometry.arrays import Array

SENSOR, AT_REST = sensor_model(SMALL), np.zeros(6)
ROOM = PaintedRoom()


def seen_back(now: RgbdFrame, earlier: RgbdFrame, T_earlier_now: Array) -> tuple[Array, Sighting]:
    """The corners of one frame (n x 2 px), and what the other one says of them."""
    view = view_of(now)
    uv = detect_corners(view.images.full, np.zeros((0, 2)), 16)
    measured = measure(view, SENSOR, uv, np.zeros((len(uv), 3)), AT_REST)
    known = measured.values[:, 2] > 0.0
    corners = CornerPatches.of(view, uv[known], measured.take(known))
    return uv[known], look_back(corners, EarlierView(view_of(earlier), T_earlier_now, AT_REST), SENSOR)


def test_a_room_stands_still_while_the_camera_walks() -> None:
    T_room_now, T_room_earlier = stroll(1.4), stroll(1.0)
    frames = [ROOM.frame(SMALL, number, T) for number, T in ((42, T_room_now), (30, T_room_earlier))]
    _, seen = seen_back(*frames, se3.inverse(T_room_earlier) @ T_room_now)
    assert seen.stands.sum() > 0.8 * seen.visible.sum()
    assert seen.moves.sum() < 0.03 * seen.visible.sum()
    assert seen.visible.sum() > 100


def test_a_quick_turn_whose_speed_is_known_to_two_per_cent_does_not_look_like_motion() -> None:
    turned, told = (se3.exp(np.array([0.0, 0.0, 0.0, 0.0, rad, 0.0])) for rad in (0.40, 0.408))
    _, seen = seen_back(ROOM.frame(SMALL, 36, turned), ROOM.frame(SMALL, 30, np.eye(4)), told)
    assert seen.stands.sum() > 60
    assert seen.moves.sum() < 0.05 * seen.visible.sum()


def test_a_body_moves_and_the_wall_behind_it_stands() -> None:
    painter = Painter(SMALL, passers_by(SMALL, 0.9, share=0.4), START, anchor_before_camera, Lens.of(SMALL))
    (now, mask), (earlier, _) = (painter.paint(ROOM.frame(SMALL, number, np.eye(4))) for number in (70, 64))
    uv, seen = seen_back(now, earlier, np.eye(4))
    u, v = own_uv(uv, 2).round().astype(int).T
    on_body = mask[v, u]
    assert on_body.sum() > 20
    assert seen.moves[on_body].mean() > 0.5
    assert seen.stands[on_body].mean() < 0.05
    assert seen.stands[~on_body & seen.visible].mean() > 0.9


def test_what_was_hidden_or_out_of_the_image_is_said_to_be_neither() -> None:
    wall = ROOM.frame(SMALL, 0, np.eye(4))
    hidden = RgbdFrame(1, START + PERIOD, wall.color, START + PERIOD, np.full_like(wall.depth_mm, 600))
    _, seen = seen_back(wall, hidden, np.eye(4))
    assert not seen.visible.any()
    away = se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 1.5, 0.0]))
    _, seen = seen_back(wall, wall, away)
    assert not (seen.visible | seen.stands | seen.moves).any()


def test_what_lies_where_the_earlier_view_saw_further_has_come_there() -> None:
    wall = ROOM.frame(SMALL, 0, np.eye(4))
    farther = RgbdFrame(1, START + PERIOD, wall.color, START + PERIOD, (wall.depth_mm * 1.5).astype(np.uint16))
    _, seen = seen_back(wall, farther, np.eye(4))
    assert seen.moves.mean() > 0.9
