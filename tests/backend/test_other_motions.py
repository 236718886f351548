"""How unsure the camera's velocity is by what else moves in its view."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from made_up_scene import chain_of_keyframes, exact, project
from painted_room import PERIOD, SMALL, START, PaintedRoom, anchor_before_camera, stroll
from sensor_models import sensor_model, view_of

from odom.backend import Odometry
from odom.backend.mapping.standing import RecentViews
from odom.backend.tracking.corner_flow import DepthlessCorners, FollowedCorners
from odom.backend.tracking.other_motions import OtherMotion, WhatElseMoves, other_motions, what_else_moves
from odom.backend.tracking.posed_frame import PosedFrame
from odom.evaluation.painter import Painter
from odom.evaluation.passers_by import passers_by
from odom.frame import RgbdFrame
from odom.frontend.camera.lens import Lens
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import EarlierView
from odom.geometry import se3
from odom.geometry.arrays import Array

PIXEL = 1.0 / 525.0
SENSOR, AT_REST, HERE = sensor_model(SMALL), np.zeros(6), np.eye(4)
ROOM = PaintedRoom()
SINCE_S = 3 * PERIOD * 1e-9
BODIES = passers_by(SMALL, 1.2, share=0.5, speed_m_s=0.6)
PAINTER = Painter(SMALL, BODIES, START, anchor_before_camera, Lens.of(SMALL))


def seen(now: RgbdFrame, earlier: RgbdFrame, T_earlier_now: Array, is_warned: bool = True) -> WhatElseMoves | None:
    earlier_view = EarlierView(view_of(earlier), T_earlier_now, AT_REST)
    return what_else_moves(earlier_view, view_of(now), AT_REST, SENSOR, is_warned)


def seen_with_a_body(number: int) -> tuple[RgbdFrame, Array]:
    """What a camera at rest sees of a body, and the body's pose."""
    seconds = number * PERIOD * 1e-9
    return PAINTER.paint(ROOM.frame(SMALL, number, HERE))[0], BODIES[0].T_anchor_body(seconds)


def test_in_a_room_at_rest_a_camera_that_walks_is_not_unsure() -> None:
    T_now, T_earlier = stroll(1.1), stroll(1.0)
    found = seen(ROOM.frame(SMALL, 33, T_now), ROOM.frame(SMALL, 30, T_earlier), se3.inverse(T_earlier) @ T_now)
    assert found is not None
    assert found.share == 0.0
    assert not found.has_scene
    assert not found.spread.any()


def test_a_first_look_is_enough_in_a_room_at_rest_and_not_where_the_camera_follows_a_body() -> None:
    T_now, T_earlier = stroll(1.1), stroll(1.0)
    now, earlier = ROOM.frame(SMALL, 33, T_now), ROOM.frame(SMALL, 30, T_earlier)
    assert seen(now, earlier, se3.inverse(T_earlier) @ T_now, is_warned=False) is None
    (now, T_body), (earlier, T_body_before) = seen_with_a_body(33), seen_with_a_body(30)
    followed = seen(now, earlier, T_body_before @ se3.inverse(T_body), is_warned=False)
    assert followed is not None
    assert followed.share > 0.2


def test_a_first_look_that_shows_too_few_corners_is_followed_by_a_second() -> None:
    frames = [ROOM.frame(SMALL, number, HERE) for number in (30, 33)]
    for frame in frames:
        frame.depth_mm[:, SMALL.width // 5 :] = 0
    assert seen(frames[1], frames[0], HERE, is_warned=False) is not None


def test_a_camera_that_follows_a_body_is_off_by_about_as_much_as_its_velocity_is_unsure() -> None:
    (now, T_body), (earlier, T_body_before) = seen_with_a_body(33), seen_with_a_body(30)
    T_followed = T_body_before @ se3.inverse(T_body)  # of the camera, as if the body stood still
    found = seen(now, earlier, T_followed)
    assert found is not None
    assert found.share > 0.2
    error = se3.log(se3.inverse(T_followed)) / SINCE_S
    assert np.linalg.norm(error) > 0.3
    nees = error @ np.linalg.solve(found.spread + np.diag(np.repeat([0.03, 0.03], 3) ** 2), error)
    assert 1.0 < nees < 9.0


@pytest.mark.parametrize("apart", [3, 8, 12])
def test_a_camera_that_follows_a_body_sees_the_scene_move_in_wide_steps_too(apart: int) -> None:
    (now, T_body), (earlier, T_body_before) = seen_with_a_body(30 + apart), seen_with_a_body(30)
    found = seen(now, earlier, T_body_before @ se3.inverse(T_body))
    assert found is not None
    assert found.has_scene
    assert not found.is_confirmed


def test_a_camera_that_follows_the_room_is_as_unsure_along_the_bodys_way_and_no_other() -> None:
    (now, T_body), (earlier, T_body_before) = seen_with_a_body(33), seen_with_a_body(30)
    found = seen(now, earlier, HERE)
    assert found is not None
    away = se3.log(T_body @ se3.inverse(T_body_before)) / SINCE_S
    values, vectors = np.linalg.eigh(found.spread)
    assert abs(vectors[:, -1] @ away) > 0.95 * np.linalg.norm(away)
    assert values[:-1].sum() < 0.2 * values[-1]
    assert values[-1] < away @ away


def test_where_too_little_can_be_followed_nothing_is_told() -> None:
    plain = ROOM.frame(SMALL, 33, HERE)
    dark = RgbdFrame(30, plain.stamp, np.zeros_like(plain.color), plain.stamp, plain.depth_mm)
    assert seen(plain, dark, HERE) is None


def test_a_camera_that_follows_a_body_sees_the_scene_move_and_one_that_follows_the_scene_does_not() -> None:
    (now, T_body), (earlier, T_body_before) = seen_with_a_body(33), seen_with_a_body(30)
    followed, stood = seen(now, earlier, T_body_before @ se3.inverse(T_body)), seen(now, earlier, HERE)
    assert followed is not None
    assert (followed.has_scene, followed.is_confirmed) == (True, False)
    assert stood is not None
    assert (stood.has_scene, stood.is_confirmed) == (False, True)


def followed_corners(
    rng: np.random.Generator, parts: list[tuple[int, float, tuple[float, float], Array]]
) -> FollowedCorners:
    """Corners followed in parts of the image: how many, how far away (m), from which column to which, and how moved."""
    points, seen = [], []
    for count, depth_m, columns, T_now_earlier in parts:
        rays = rng.uniform((columns[0], -0.4), (columns[1], 0.4), (count, 2))
        points.append(np.column_stack([rays, np.ones(count)]) * rng.uniform(0.95, 1.05, (count, 1)) * depth_m)
        seen.append(project(T_now_earlier, points[-1]))
    values = np.concatenate(seen)
    covariances = np.tile(np.eye(3) * 1e-6, (len(values), 1, 1))
    uv = values[:, :2] / PIXEL + (320.0, 240.0)
    return FollowedCorners(np.concatenate(points), covariances, uv, exact(values), PIXEL)


def only_other_motion(body: int, near: int, T_true: Array) -> OtherMotion:
    """The motion that a camera sees which follows a body and a far wall: that of a desk, and as well of the wall."""
    T_followed = np.eye(4)
    parts = [(body, 0.7, (-0.4, -0.2), T_followed), (near, 1.2, (-0.1, 0.5), T_true), (120, 40.0, (-0.5, 0.5), T_true)]
    others = list(other_motions(followed_corners(np.random.default_rng(1), parts), T_followed, 0.1))
    assert len(others) == 1
    return others[0]


def test_a_wall_so_far_that_it_agrees_with_both_motions_says_nothing_for_the_one_that_is_followed() -> None:
    aside = se3.exp(np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0]))
    other = only_other_motion(body=20, near=40, T_true=aside)
    assert other.is_behind
    assert other.share > 0.5
    assert other.is_scene


def test_a_body_that_passes_before_scene_and_wall_is_not_the_scene_however_many_features_it_has() -> None:
    aside = se3.exp(np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0]))
    parts = [(80, 0.7, (-0.4, -0.2), aside), (20, 1.2, (-0.1, 0.5), np.eye(4)), (120, 40.0, (-0.5, 0.5), np.eye(4))]
    others = list(other_motions(followed_corners(np.random.default_rng(1), parts), np.eye(4), 0.1))
    assert others
    assert not any(one.is_behind or one.is_scene for one in others)


def test_a_motion_that_hardly_differs_from_the_cameras_is_not_the_scenes() -> None:
    bent = se3.exp(np.array([0.011, 0.0, 0.0, 0.0, 0.0, 0.0]))
    other = only_other_motion(body=20, near=40, T_true=bent)
    assert not other.is_scene
    assert other.share < 0.3


def depthless(T_now_earlier: Array, nearest_m: float) -> DepthlessCorners:
    """Corners without depth in a scene that the camera moves through."""
    rng = np.random.default_rng(2)
    rays = rng.uniform((-0.5, -0.4), (0.5, 0.4), (60, 2))
    points = np.column_stack([rays, np.ones(60)]) / rng.uniform(0.0, 1.0 / nearest_m, (60, 1))
    followed = project(T_now_earlier, points)[:, :2]
    return DepthlessCorners(rays, followed)


def test_corners_without_depth_agree_with_the_motion_of_a_camera_before_a_scene_at_rest() -> None:
    T_now = se3.exp(np.array([0.04, -0.02, 0.05, 0.02, -0.03, 0.04]))
    assert depthless(T_now, nearest_m=0.6).off_line(T_now).max() < 1e-9


def test_corners_without_depth_deny_the_motion_of_a_camera_that_follows_a_body() -> None:
    T_now, T_followed = se3.exp(np.array([0.0, 0.02, 0, 0, 0.01, 0.02])), se3.exp(np.array([0.05, 0, 0.01, 0, 0.04, 0]))
    corners = depthless(T_now, nearest_m=1.0)
    assert corners.against(T_followed, PIXEL) > 0.9
    assert corners.against(T_now, PIXEL) == 0.0
    assert DepthlessCorners(*np.zeros((2, 0, 2))).against(T_followed, PIXEL) == 0.0


def test_near_and_far_corners_together_are_no_body() -> None:
    body, desk_and_wall = [(40, 0.7, (-0.4, 0.0), HERE)], [(40, 0.8, (-0.4, 0.0), HERE), (40, 2.0, (0.0, 0.4), HERE)]
    for parts, may_be in ((body, True), (desk_and_wall, False)):
        corners = followed_corners(np.random.default_rng(1), parts)
        assert corners.may_be_a_body(np.ones(len(corners.uv), dtype=np.bool_)) == may_be
        assert not corners.may_be_a_body(np.zeros(len(corners.uv), dtype=np.bool_))


def test_a_camera_that_follows_a_body_which_alone_has_depth_is_denied_and_one_that_follows_the_room_is_not() -> None:
    (now, T_body), (earlier, T_body_before) = seen_with_a_body(33), seen_with_a_body(30)

    def near_only(frame: RgbdFrame) -> RgbdFrame:
        return replace(frame, depth_mm=np.where(frame.depth_mm < 1300, frame.depth_mm, 0).astype(np.uint16))

    followed = seen(near_only(now), near_only(earlier), T_body_before @ se3.inverse(T_body))
    assert followed is not None
    assert followed.is_denied
    assert followed.behind > 0.5
    stood = seen(now, earlier, HERE)
    assert stood is not None
    assert not stood.is_denied


def remembered(apart: int, begins: tuple[int, ...] = (0,)) -> tuple[RecentViews, View, Any]:
    """A view of key frame 0 that is remembered, and another view so many frames later, tracked by key frame 1."""
    views = [view_of(seen_with_a_body(number)[0]) for number in (30, 30 + apart)]
    recent, none = RecentViews(chain_of_keyframes([HERE, HERE], np.eye(6), begins)), np.zeros(0, dtype=np.int64)
    tracked = cast(Any, SimpleNamespace(twist=AT_REST, T_map_camera=HERE, reference=1))
    recent.remember(PosedFrame(views[0], tracked, HERE, AT_REST, 0, none, np.zeros((0, 2))))
    return recent, views[1], tracked


@pytest.mark.parametrize(("apart", "is_told"), [(12, True), (30, False)])
def test_in_a_slow_stream_it_is_still_told_what_moves_and_not_after_a_second(apart: int, is_told: bool) -> None:
    recent, view, tracked = remembered(apart)
    assert (recent.what_else_moves(view, tracked, SENSOR, True) is not None) == is_told
    moving = recent.moving(view, tracked, SENSOR)
    assert (moving is not None) == is_told
    assert moving is None or moving.share > 0.1


def test_a_view_of_another_segment_does_not_tell_what_moves() -> None:
    recent, view, tracked = remembered(12, begins=(0, 1))
    assert recent.what_else_moves(view, tracked, SENSOR, True) is None
    assert recent.moving(view, tracked, SENSOR) is None


@pytest.mark.parametrize(("apart", "is_kept"), [(1, False), (8, True)])
def test_in_a_slow_stream_the_view_that_began_a_segment_tells_what_moves_since(apart: int, is_kept: bool) -> None:
    odometry = Odometry(SMALL)
    for number in (0, apart):
        odometry.process(ROOM.frame(SMALL, number, HERE @ se3.exp(0.001 * number * np.eye(6)[0])))
    kept = [one.view.sequence for one in odometry._stages.mapper.inserter.recent._views]
    assert kept == ([0, apart] if is_kept else [apart])
