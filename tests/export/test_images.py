"""The images of an export: the sharpest, without distortion, without rolling shutter."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from painted_room import SMALL, stroll
from room_survey import EVERY, ROOM, RoomRecording, exact_survey

from odom.export.cloud import VoxelCloud
from odom.export.rectify import Rectifier, pinhole_of
from odom.export.selection import sharpest, sharpness
from odom.export.surface import surface_depth
from odom.export.views import views
from odom.frame import Camera
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.matching.optical_flow import follow_there_and_back
from odom.geometry import se3

DISTORTED = replace(SMALL, distortion=(0.1, -0.15, 0.001, -0.002, 0.05))
STILL = np.zeros(6)


def test_of_the_frames_around_a_key_frame_the_sharpest_is_chosen():
    values = [1.0] * 20
    values[4], values[11], values[12] = 2.0, 3.0, 1.05
    assert sharpest([3, 10, 15], values, 2) == [4, 11, 15]
    assert sharpest([3, 10, 15], values, 0) == [3, 10, 15]


def test_no_frame_is_chosen_twice():
    rng = np.random.default_rng(0)
    for _ in range(50):
        keyframes = sorted(rng.choice(60, 12, replace=False).tolist())
        chosen = sharpest(keyframes, rng.uniform(1, 5, 60).tolist(), 6)
        assert len(set(chosen)) == 12
        assert chosen == sorted(chosen)


def test_a_blurred_image_is_less_sharp():
    image = ROOM.render(SMALL, stroll(0))[0]
    assert sharpness(cv2.blur(image, (5, 5))) < 0.5 * sharpness(image)


def test_points_are_carried_to_where_they_are_in_the_neighbour():
    survey = exact_survey()
    keyframe = survey.scene.keyframes[2]
    grey, other = (ROOM.render(SMALL, stroll(k / 30))[0] for k in (2 * EVERY, 2 * EVERY + 1))
    there = se3.apply(se3.inverse(stroll((2 * EVERY + 1) / 30)), survey.scene.points[keyframe.landmarks])
    expected = there[:, :2] / there[:, 2:] * [SMALL.fx, SMALL.fy] + [SMALL.cx, SMALL.cy]
    uv, found = follow_there_and_back(grey, other, keyframe.uv, keyframe.uv, 0.5, 1.0)
    assert found.mean() > 0.8
    assert np.median(np.linalg.norm(uv - expected, axis=1)[found]) < 0.1
    none = np.zeros((0, 2))
    assert follow_there_and_back(grey, other, none, none, 0.5, 1.0)[0].shape == (0, 2)


def test_a_sharper_neighbour_stands_for_its_key_frame_with_its_own_pose():
    survey = exact_survey()
    sharp = list(survey.sharpness)
    sharp[21] = 9.0
    seen = list(views(replace(survey, sharpness=tuple(sharp)), RoomRecording([0, 10, 20, 21, 30]), neighbours=2))
    assert [view.stamp for view in seen][2] == survey.stamps[21]
    assert np.allclose(seen[2].T_map_camera, stroll(21 / 30), atol=1e-9)
    projected = se3.apply(se3.inverse(seen[2].T_map_camera), survey.scene.points[seen[2].landmarks])
    uv = projected[:, :2] / projected[:, 2:] * [SMALL.fx, SMALL.fy] + [SMALL.cx, SMALL.cy]
    assert np.median(np.linalg.norm(uv - seen[2].uv, axis=1)) < 0.1


def test_an_image_without_a_pose_stands_for_no_key_frame():
    """A neighbour may have been LOST, or be of another part: its pose would be one of somewhere else."""
    survey = exact_survey()
    sharp = list(survey.sharpness)
    sharp[21], sharp[22], sharp[58] = 9.0, 4.0, 9.0
    whole = survey.scene.trajectory
    is_kept = np.isin(np.arange(len(whole)), [21, *range(55, 61)], invert=True)
    scene = replace(survey.scene, trajectory=whole.take(is_kept))
    chosen = replace(survey, scene=scene, sharpness=tuple(sharp)).chosen(2)
    assert chosen[survey.stamps[20]] == survey.stamps[22]
    assert chosen[survey.stamps[60]] == survey.stamps[60]


def test_an_undistorted_image_is_that_of_the_pinhole_camera():
    T = stroll(0.3)
    grey, depth_mm = ROOM.render(DISTORTED, T)
    rectifier = Rectifier(DISTORTED)
    sources = rectifier.sources(depth_mm, STILL)
    expected_grey, expected_depth = ROOM.render(rectifier.pinhole, T)
    assert np.median(np.abs(rectifier.color(grey, sources).astype(int) - expected_grey)) <= 2
    assert np.median(np.abs(rectifier.depth(depth_mm, sources).astype(int) - expected_depth)) <= 3
    assert (rectifier.depth(depth_mm, sources) > 0).all()


def test_pixels_of_the_image_as_taken_are_found_where_the_pinhole_camera_has_them():
    rectifier = Rectifier(DISTORTED, readout_s=0.02)
    twist = np.array([0.3, 0.1, -0.2, 0.2, -0.5, 0.3])
    depth_mm = np.full((SMALL.height, SMALL.width), 1500, np.uint16)
    sources = rectifier.sources(depth_mm, twist)
    v, u = np.mgrid[20:220:20, 20:300:20].reshape(2, -1)
    back = rectifier.points(sources[v, u].astype(np.float64), np.full(len(u), 1.5), twist)
    assert np.abs(back - np.column_stack([u, v])).max() < 0.1


def test_a_rolled_image_is_unrolled():
    readout_s, t = 0.03, 0.4
    T_middle, dt = stroll(t), 1e-3
    twist = se3.log(se3.inverse(stroll(t - dt)) @ stroll(t + dt)) / (2 * dt) * 8.0  # a quick walk
    tiny = Camera(160, 120, 131.25, 131.25, 79.5, 59.5)
    tops = range(0, tiny.height, 8)
    drawn = [ROOM.render(tiny, T_middle @ se3.exp(twist * readout_s * (top / tiny.height - 0.5))) for top in tops]
    grey, depth_mm = (
        np.concatenate([both[which][top : top + 8] for both, top in zip(drawn, tops, strict=True)]) for which in (0, 1)
    )
    expected = ROOM.render(tiny, T_middle)[0].astype(int)[9:-9, 9:-9]
    rectifier = Rectifier(tiny, readout_s)
    unrolled = rectifier.color(grey, rectifier.sources(depth_mm, twist)).astype(int)[9:-9, 9:-9]
    rolled = grey.astype(int)[9:-9, 9:-9]
    assert np.abs(unrolled - expected).mean() < 0.35 * np.abs(rolled - expected).mean()


def test_without_distortion_a_pinhole_camera_is_itself():
    assert pinhole_of(SMALL) == SMALL
    assert pinhole_of(replace(SMALL, distortion=(0.0,) * 5)) == SMALL


def test_the_velocity_is_that_of_the_walk():
    scene = replace(exact_survey().scene, timing=ShutterTiming(readout_s=0.02))
    stamp = int(scene.trajectory.stamps[30])
    t, dt = 1.0 - 0.01, 1e-3
    expected = se3.log(se3.inverse(stroll(t - dt)) @ stroll(t + dt)) / (2 * dt)
    assert np.allclose(scene.twist_of_color(stamp), expected, atol=0.01)
    assert np.allclose(scene.pose_of_color(stamp), stroll(t), atol=1e-4)


@pytest.mark.parametrize("stamp_s", [-10.0, 10.0])
def test_beyond_the_ends_of_a_trajectory_its_ends_count(stamp_s):
    scene = exact_survey().scene
    end = scene.trajectory.T_world_body[0 if stamp_s < 0 else -1]
    assert np.allclose(scene.pose_at(scene.trajectory.stamps[0] + stamp_s * 1e9), end)


def test_steps_of_depth_and_what_is_far_are_no_surface():
    depth = np.full((40, 40), 1500, np.uint16)
    depth[:, 20:], depth[:5], depth[30:] = 2000, 0, 5000
    kept = surface_depth(depth, 4.0)
    assert (kept[7:28, :18] == 1500).all()
    assert (kept[7:28, 22:] == 2000).all()
    assert not kept[:5].any()
    assert not kept[31:].any()
    assert not kept[7:28, 19:21].any()
    slanted = np.tile(np.linspace(1000, 2000, 40).astype(np.uint16), (40, 1))
    assert (surface_depth(slanted, 4.0) > 0).all()


def test_a_cloud_has_one_mean_a_cube_however_it_was_filled(monkeypatch):
    rng = np.random.default_rng(0)
    points, colors = rng.uniform(-0.5, 0.5, (5000, 3)), rng.integers(0, 256, (5000, 3), dtype=np.uint8)
    monkeypatch.setattr("odom.export.cloud._PENDING", 300)
    once, often = VoxelCloud(0.1), VoxelCloud(0.1)
    once.add(np.eye(4), points, colors)
    for part in range(0, 5000, 500):
        often.add(np.eye(4), points[part : part + 500], colors[part : part + 500])
    for a, b in zip(once.result(), often.result(), strict=True):
        assert np.allclose(a, b)
    assert len(once.result()[0]) == len(np.unique(np.floor(points / 0.1), axis=0)) > 900
    cube = (points >= 0).all(axis=1) & (points < 0.1).all(axis=1)
    mean = points[cube].mean(axis=0)
    assert np.abs(once.result()[0] - mean).sum(axis=1).min() < 1e-9
    assert len(VoxelCloud(0.1).result()[0]) == 0


def test_what_a_mask_marks_has_no_depth():
    marked = np.zeros((SMALL.height, SMALL.width), dtype=bool)
    marked[200:] = True
    plain = exact_survey()
    for with_all, seen in zip(
        views(plain, RoomRecording()),
        views(replace(plain, segmenter=lambda frame: marked), RoomRecording()),
        strict=True,
    ):
        assert with_all.depth_mm[marked].any()
        assert not seen.depth_mm[marked].any()
        assert (seen.depth_mm == with_all.depth_mm)[~marked].all()
        assert (seen.color == with_all.color).all()
