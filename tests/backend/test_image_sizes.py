"""Small and large cameras: people before them are not followed; what leaves the odometry is in their own pixels."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn import frame
from painted_room import SMALL, START, PaintedRoom, anchor_before_camera, stroll

from odom import Camera, Odometry, Trajectory, read_recording
from odom.evaluation.painter import Painter
from odom.evaluation.passers_by import passers_by
from odom.evaluation.robustness.verdict import Verdict, verdict
from odom.export.scene import scene_of
from odom.frontend.camera.lens import Lens
from odom.geometry import se3
from sensors.arena import ArenaOptions
from sensors.arena.options import halved

ROOM = PaintedRoom(seed=7)
LARGE = Camera(1280, 960, 1050.0, 1050.0, 639.5, 479.5)
small_and_large = pytest.mark.parametrize("camera", [SMALL, LARGE], ids=["320 x 240", "1280 x 960"])
BORDER_PX = 3.0
"""Nearer to the image's border nothing is followed."""


def among_people(seed: int, begin_s: float, end_s: float) -> Verdict:
    """The verdict on a part of a walk of 15 Hz among the arena's four people."""
    options = ArenaOptions(people=4, half=True, seed=seed)
    assert (options.camera.width, options.camera.height) == (320, 240)
    odometry = Odometry(options.camera)
    frames = [frame(options, k) for k in range(int(30 * begin_s), int(30 * end_s), 2)]
    estimates = [odometry.process(drawn.rgbd()) for drawn in frames]
    truth = Trajectory(np.array([f.stamp for f in frames]), np.array([f.T_world_camera for f in frames]))
    found = verdict(estimates, Trajectory.of(odometry.finish()), truth)
    print(f"seed {seed}: {found}")
    return found


def test_people_who_walk_before_a_small_camera_are_not_followed() -> None:
    found = among_people(66, 6.0, 9.2)
    assert found.judged > 10
    assert found.wrong == 0.0
    assert found.ate_m is not None
    assert found.ate_m < 0.02


@pytest.mark.long
@pytest.mark.parametrize("seed", [66, 76, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (71, 74, 75))])
def test_on_longer_walks_among_people_a_small_camera_is_nowhere_sure_and_wrong(seed: int) -> None:
    found = among_people(seed, 0.0, 12.0)
    assert found.wrong == 0.0
    assert found.tracked > 0.4
    assert found.lost < 0.1
    assert found.ate_m is not None
    assert found.ate_m < 0.01


@small_and_large
def test_features_are_where_the_image_shows_them(camera: Camera) -> None:
    odometry, told, uv = Odometry(camera), [], []
    for number in range(12):
        estimate = odometry.process(ROOM.frame(camera, 2 * number, stroll(number / 15)), told.append)
        if estimate.features is not None:
            np.testing.assert_array_equal(told[-1].features.uv, estimate.features.uv)
            uv.append(estimate.features.uv)
    low, high = np.concatenate(uv).min(axis=0), np.concatenate(uv).max(axis=0)
    size = np.array([camera.width, camera.height])
    assert (low > BORDER_PX - 1.0).all()
    assert (low < 0.1 * size).all()
    assert (high < size - BORDER_PX).all()
    assert (high > 0.9 * size).all()


@small_and_large
def test_landmarks_that_are_exported_are_where_the_image_shows_them(camera: Camera) -> None:
    odometry = Odometry(camera)
    for number in range(4):
        odometry.process(ROOM.frame(camera, number, np.eye(4)))
    scene, lens = scene_of(camera, odometry.timing, odometry.finish(), odometry.map), Lens.of(camera)
    (keyframe,) = scene.keyframes
    points, T = scene.points[keyframe.landmarks], se3.inverse(keyframe.T_map_camera)
    seen = lens.project(points, T)[:, :2]
    assert len(seen) > 100
    assert np.linalg.norm(np.nanmedian(seen - keyframe.uv, axis=0)) < 0.05


@small_and_large
def test_cells_that_move_are_where_the_image_shows_the_body(camera: Camera) -> None:
    painter = Painter(camera, passers_by(camera, 0.9, share=0.4), START, anchor_before_camera, Lens.of(camera))
    odometry, shares = Odometry(camera), []
    for number in range(0, 75, 2):
        painted, mask = painter.paint(ROOM.frame(camera, number, np.eye(4)))
        moving = odometry.process(painted).moving
        if moving is not None and moving.mask.any():
            assert moving.image_shape == (camera.height, camera.width)
            shown = moving.over_image()
            assert shown.shape == mask.shape
            shares.append((shown & mask).sum() / shown.sum())
    assert len(shares) > 10
    assert np.median(shares) > 0.7


@pytest.mark.long
@pytest.mark.parametrize(("name", "ate_m"), [("tum_fr1_xyz", 0.0045), ("tum_fr1_rpy_part", 0.0065)])
def test_a_recording_in_half_size_is_tracked_nearly_as_well(shared_data, name: str, ate_m: float) -> None:
    recording = read_recording(shared_data / name)
    odometry, estimates = Odometry(halved(recording.camera, 0.5)), []
    for large in recording:
        color = cv2.resize(large.color, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        depth_mm = np.ascontiguousarray(large.depth_mm[::2, ::2])
        estimates.append(odometry.process(replace(large, color=color, depth_mm=depth_mm)))
    found = verdict(estimates, Trajectory.of(odometry.finish()), recording.truth()["camera"])
    assert found.wrong == 0.0
    assert found.lost == 0.0
    assert found.ate_m is not None
    assert found.ate_m < ate_m


@pytest.mark.long
def test_a_body_before_a_large_camera_is_not_followed_nor_are_frames_lost(shared_data) -> None:
    recording = read_recording(shared_data / "tum_fr1_xyz", end=7.0)
    c = recording.camera
    cx, cy = 3 * (c.cx + 0.5) - 0.5, 3 * (c.cy + 0.5) - 0.5
    camera = replace(c, width=3 * c.width, height=3 * c.height, fx=3 * c.fx, fy=3 * c.fy, cx=cx, cy=cy)
    painter = Painter(c, passers_by(c, 0.66, seed=3), next(iter(recording)).stamp, anchor_before_camera, Lens.of(c))
    odometry, estimates = Odometry(camera), []
    for usual in recording:
        painted, _ = painter.paint(usual)
        color = cv2.resize(painted.color, None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC)
        depth_mm = painted.depth_mm.repeat(3, axis=0).repeat(3, axis=1)
        estimates.append(odometry.process(replace(painted, color=color, depth_mm=depth_mm)))
    found = verdict(estimates, Trajectory.of(odometry.finish()), recording.truth()["camera"])
    print(found)
    assert found.wrong == 0.0
    assert found.lost == 0.0
    assert found.ate_m is not None
    assert found.ate_m < 0.006
