from dataclasses import replace

import numpy as np
import pytest
from painted_room import anchor_before_camera

from odom import Camera, InputError, RgbdFrame, Trajectory
from odom.evaluation.painter import Painter, anchor_at_rest, anchor_in_world, seen
from odom.evaluation.passers_by import passers_by
from odom.frontend.camera.lens import Lens
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3

CAMERA = Camera(160, 120, 131.0, 131.0, 79.5, 59.5)
LENS = Lens.of(CAMERA)
BEGIN = 10**18


def wall(depth_mm: int, after_s: float = 0.0, depth_after_s: float = 0.0) -> RgbdFrame:
    stamps = [BEGIN + round(1e9 * s) for s in (after_s, after_s + depth_after_s)]
    grey = np.full((120, 160, 3), 128, np.uint8)
    return RgbdFrame(0, stamps[0], grey, stamps[1], np.full((120, 160), depth_mm, np.uint16))


def painter(**changes) -> Painter:
    bodies = passers_by(CAMERA, 1.2, **changes)
    return Painter(CAMERA, bodies, BEGIN, anchor_before_camera, LENS)


def test_a_body_has_the_share_of_the_view_that_was_asked_for():
    masks = [painter(share=0.4).paint(wall(3000, t))[1] for t in np.linspace(0, 8, 60)]
    widths = [mask.any(axis=0).mean() for mask in masks]
    assert 0.3 < max(widths) < 0.5


def test_colour_and_depth_show_the_same_body_at_the_same_place():
    for t in (0.5, 1.7, 2.9):
        frame = wall(3000, t)
        painted, mask = painter().paint(frame)
        assert ((painted.depth_mm != 3000) == mask).all()
        assert ((painted.color != frame.color).any(axis=2) & ~mask).sum() == 0


def test_depth_is_that_of_its_own_stamp():
    late = painter(speed_m_s=1.5).paint(wall(3000, 0.6, 0.02))[0].depth_mm
    assert (late == painter(speed_m_s=1.5).paint(wall(3000, 0.62))[0].depth_mm).all()
    assert (late != painter(speed_m_s=1.5).paint(wall(3000, 0.6))[0].depth_mm).any()


def test_what_stands_before_a_body_hides_it():
    frame = wall(3000)
    half = frame.depth_mm.copy()
    half[:, :80] = 400
    painted, mask = painter(share=1.0).paint(replace(frame, depth_mm=half))
    assert not mask[:, :80].any()
    assert mask[:, 80:].any()
    assert (painted.depth_mm[:, :80] == 400).all()


def test_a_body_walks_on_one_line_at_the_speed_that_was_asked_for():
    body = passers_by(CAMERA, 1.2, speed_m_s=0.5)[0]
    at = np.array([body.T_anchor_body(t)[:3, 3] for t in np.arange(0, 20, 0.05)])
    speeds = np.linalg.norm(np.diff(at[:, [0, 2]], axis=0), axis=1) / 0.05
    assert 0.3 < np.median(speeds) < 0.8
    assert speeds.max() < 1.2


def test_a_body_that_rests_stands_still_at_first_and_time_and_again_and_walks_on_from_where_it_stood():
    body, walker = passers_by(CAMERA, 1.2, rest=True)[0], passers_by(CAMERA, 1.2)[0]
    (_, first_end), (second_begin, second_end) = body.rests[:2]
    assert 1.0 <= first_end <= 5.0
    for begin, end in ((0.0, first_end), (second_begin, second_end)):
        np.testing.assert_allclose(body.T_anchor_body(begin + 0.1), body.T_anchor_body(end - 0.1), atol=1e-12)
    for walked_s in (0.0, 0.2, 0.4):
        np.testing.assert_allclose(body.T_anchor_body(first_end + walked_s), walker.T_anchor_body(walked_s), atol=1e-12)
    assert body.rests[-1][1] > 590.0


def test_rows_that_are_read_one_after_another_show_a_body_each_at_its_own_time():
    bodies, frame = passers_by(CAMERA, 1.2, speed_m_s=3.0), wall(3000, 0.6)
    rolling = Painter(CAMERA, bodies, BEGIN, anchor_before_camera, LENS, timing=ShutterTiming(0.024, -0.03, 0.036))
    painted, mask = rolling.paint(frame)
    late_s, height = 0.024 * (0.5 - 5.5 / 12), slice(50, 60)  # the sixth of twelve bands of ten rows
    at_its_time = painter(speed_m_s=3.0).paint(wall(3000, 0.6 - 0.012 - late_s))
    np.testing.assert_array_equal(mask[height], at_its_time[1][height])
    assert (mask[:10] != at_its_time[1][:10]).any()
    depth_late_s = -0.03 - 0.036 * (0.5 - 5.5 / 12)
    of_depth = painter(speed_m_s=3.0).paint(wall(3000, 0.6, depth_late_s))[0].depth_mm
    np.testing.assert_array_equal(painted.depth_mm[height] != 3000, of_depth[height] != 3000)


def test_a_body_at_rest_in_the_world_moves_in_the_view_as_the_camera_does():
    stamps = BEGIN + np.arange(0, 3 * 10**9, 10**8)
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    poses[:, 0, 3] = np.linspace(0.0, 0.3, len(stamps))
    T_camera_anchor = anchor_at_rest(Trajectory(stamps, poses))
    first, last = T_camera_anchor(BEGIN), T_camera_anchor(int(stamps[-1]))
    np.testing.assert_allclose(first[:3, 3] - last[:3, 3], [0.3, 0.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(T_camera_anchor(BEGIN - 10**9), first)
    with pytest.raises(InputError, match="path is empty"):
        anchor_at_rest(Trajectory(stamps[:0], poses[:0]))


def test_a_point_of_the_body_keeps_its_print_and_its_depth_is_that_of_the_geometry():
    body = passers_by(CAMERA, 1.2, seed=5)[0]
    T_world_body = np.eye(4)
    T_world_body[:3, 3] = 0.1, 0.05, 1.3
    T_camera_world = se3.exp(np.array([0.2, -0.1, 0.15, 0.05, -0.1, 0.2]))
    points = []
    for T in (T_world_body, T_camera_world @ T_world_body):
        depth, x, y = seen(body, T, LENS.rays)
        hit = np.isfinite(depth)
        rays = np.column_stack([LENS.rays[hit], np.ones(hit.sum())])
        in_body = se3.apply(se3.inverse(T), rays * depth[hit][:, None])
        on_front = (in_body[:, 0] / body.width_m * 2) ** 2 + (in_body[:, 2] / body.thickness_m * 2) ** 2
        np.testing.assert_allclose(on_front, 1, atol=2e-3)
        points.append((in_body, np.column_stack([x[hit], y[hit]])))
    size = np.array(body.front.shape[1::-1])
    for in_body, texels in points:
        expected = (in_body[:, :2] / (body.width_m, body.height_m) + 0.5) * size - 0.5
        np.testing.assert_allclose(texels, expected, atol=0.05)


def test_bodies_in_the_world_do_not_follow_the_quick_motions_of_the_camera():
    stamps = BEGIN + np.arange(0, 10_000_000_000, 10_000_000)
    T = np.tile(np.eye(4), (len(stamps), 1, 1))
    T[:, 0, 3] = 0.1 * np.sin(2 * np.pi * 1.5 * (stamps - BEGIN) * 1e-9) + 0.3 * (stamps - BEGIN) * 1e-9
    anchor = anchor_in_world(Trajectory(stamps, T))
    in_world = np.array([(T[k] @ anchor(stamps[k]))[:3, 3] for k in range(300, 700)])
    np.testing.assert_allclose(np.diff(in_world[:, 0]), 0.003, atol=5e-4)


def test_equal_seeds_paint_equal_frames_in_any_order():
    frames = [wall(3000, t) for t in (0.3, 1.1, 2.4)]
    forwards = [painter(count=3, seed=7).paint(f)[0] for f in frames]
    same = painter(count=3, seed=7)
    backwards = [same.paint(f)[0] for f in reversed(frames)][::-1]
    for a, b in zip(forwards, backwards, strict=True):
        assert (a.color == b.color).all()
        assert (a.depth_mm == b.depth_mm).all()
    other = painter(count=3, seed=8).paint(frames[0])[0]
    assert (other.color != forwards[0].color).any()


def test_a_grey_image_stays_grey_and_no_bodies_leave_the_frame_as_it_is():
    frame = wall(3000)
    painted, _ = painter().paint(replace(frame, color=frame.color[..., 0]))
    assert painted.color.ndim == 2
    untouched, nothing = painter(count=0).paint(frame)
    assert not nothing.any()
    assert (untouched.color == frame.color).all()
    assert (untouched.depth_mm == frame.depth_mm).all()


def test_a_body_that_nobody_sees_changes_nothing():
    hidden = replace(wall(400), color=np.full((120, 160), 128, np.uint8))
    painted, mask = painter().paint(hidden)
    assert not mask.any()
    assert (painted.color == hidden.color).all()
    assert (painted.depth_mm == 400).all()


@pytest.mark.parametrize("wrong", [{"share": 0.0}, {"speed_m_s": -1.0}, {"count": -1}])
def test_a_body_that_cannot_be_is_refused(wrong):
    with pytest.raises(InputError):
        passers_by(CAMERA, 1.2, **wrong)
