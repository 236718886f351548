"""Lost views that show the scene by themselves, whatever walks before it, so that a segment may begin."""

from dataclasses import replace

import numpy as np
from painted_room import PERIOD, SMALL, START, PaintedRoom, anchor_before_camera, stroll
from sensor_models import sensor_model, view_of

from odom.backend.map.map import Map
from odom.backend.mapping.keyframe_inserter import KeyframeInserter
from odom.backend.odometry.lost_views import LostViews
from odom.backend.odometry.tuning import TUNING
from odom.backend.settings import OdometrySettings
from odom.backend.tracking.scene_motion import scene_motion
from odom.evaluation.painter import Painter
from odom.evaluation.passers_by import PasserBy, passers_by
from odom.frame import RgbdFrame
from odom.frontend.camera.lens import Lens
from odom.frontend.features.image_scale import own_uv
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask

SENSOR, ROOM = sensor_model(SMALL), PaintedRoom()
NOBODY: tuple[PasserBy, ...] = ()
BODY = passers_by(SMALL, 0.9, share=0.4, speed_m_s=0.8)
FIRST = 46


def shown(number: int, bodies: tuple[PasserBy, ...]) -> tuple[RgbdFrame, Mask, Array]:
    """Frame `number` of a stroll among `bodies`, which of its pixels show one, and T_room_camera."""
    T = stroll(number * PERIOD * 1e-9)
    painter = Painter(SMALL, bodies, START, anchor_before_camera, Lens.of(SMALL))
    return *painter.paint(ROOM.frame(SMALL, number, T)), T


def looked(bodies: tuple[PasserBy, ...], count: int, *, in_doubt: bool = True) -> LostViews:
    lost = LostViews()
    for number in range(FIRST, FIRST + count):
        lost = lost.after(view_of(shown(number, bodies)[0]), SENSOR, in_doubt)
    return lost


def error_m(T_view_earlier: Array | None, now: int, earlier: int) -> float:
    assert T_view_earlier is not None
    T = se3.inverse(shown(earlier, NOBODY)[2]) @ shown(now, NOBODY)[2]
    return float(np.linalg.norm(se3.log(T_view_earlier @ T)[:3]))


def test_two_views_show_the_cameras_motion_by_the_room_and_not_by_who_walks_before_it() -> None:
    for bodies in (NOBODY, BODY):
        (earlier, _, _), (now, mask, _) = shown(FIRST, bodies), shown(FIRST + 2, bodies)
        assert (mask.mean() > 0.2) == bool(bodies)
        assert error_m(scene_motion(view_of(earlier), view_of(now), SENSOR), FIRST + 2, FIRST) < 0.01


def test_a_body_before_a_scene_in_which_nothing_can_be_followed_is_not_taken_for_it() -> None:
    views = []
    for number in (FIRST, FIRST + 2):
        frame, mask, _ = shown(number, BODY)
        views.append(view_of(replace(frame, color=np.where(mask, frame.color, 128).astype(np.uint8))))
    assert scene_motion(views[0], views[1], SENSOR) is None


def test_two_looks_running_tell_and_a_segment_begins_sooner_then() -> None:
    assert looked(BODY, 2).latest is None
    once, twice = looked(BODY, 3), looked(BODY, 4)
    assert once.latest is not None
    assert once.scene is None
    assert once.patience == TUNING.patience
    assert twice.scene is not None
    assert twice.patience < 1.0


def test_without_doubt_and_after_a_gap_nothing_is_told() -> None:
    assert looked(BODY, 4, in_doubt=False).patience == 1.0
    later = looked(BODY, 4).after(view_of(shown(FIRST + 30, BODY)[0]), SENSOR, True)
    assert later.latest is None
    assert len(later.views) == 1


def test_a_segment_begins_with_the_corners_of_the_room_only() -> None:
    frame, mask, _ = shown(FIRST + 3, BODY)
    inserter = KeyframeInserter(Map(), OdometrySettings())
    everything = inserter.first_corners(view_of(frame), SENSOR)
    standing = inserter.first_corners(view_of(frame), SENSOR, looked(BODY, 4).scene)
    assert everything is not None
    assert standing is not None

    def on_body(uv: Array) -> float:
        u, v = own_uv(uv, 2).round().astype(int).T
        return float(mask[v, u].mean())

    assert on_body(everything.uv) > 0.1
    assert on_body(standing.uv) < 0.02
    assert len(standing.uv) > 0.5 * (1.0 - on_body(everything.uv)) * len(everything.uv)


def test_in_a_quick_stream_an_earlier_view_is_always_long_enough_ago() -> None:
    lost, step = LostViews(), PERIOD // 7
    for number in range(7 * FIRST, 7 * FIRST + 60):
        T = stroll(number * step * 1e-9)
        frame = replace(ROOM.frame(SMALL, number, T), stamp=START + number * step, depth_stamp=START + number * step)
        lost = lost.after(view_of(frame), SENSOR, True)
    assert lost.scene is not None
    assert len(lost.views) <= 8
