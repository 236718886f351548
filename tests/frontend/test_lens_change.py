"""What was measured through one lens, told through another, is what the other would have measured."""

from dataclasses import replace

import numpy as np
import pytest

from odom.frame import Camera, DepthModel
from odom.frame.depth_model import as_measured
from odom.frontend.camera.lens import Lens, rays_at
from odom.frontend.features.lens_change import LensChange
from odom.frontend.features.shutter_compensation import depth_errors
from odom.geometry import se3

GIVEN = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
FOUND = {
    "longer": replace(GIVEN, fx=532.0, fy=530.0),
    "aside": replace(GIVEN, cx=315.0, cy=262.0),
    "bent": replace(GIVEN, distortion=(0.2, -0.5, 0.001, -0.002, 0.4)),
    "depth": replace(GIVEN, depth=DepthModel(offset=(0.01, 0, 0, 0, 0, 0), scale=(1.02, 0.01, 0, 0, 0, -0.01))),
}
RNG = np.random.default_rng(1)
UV = RNG.uniform((5, 5), (634, 474), (300, 2))
MEASURED = RNG.uniform(0.2, 1.6, 300)
FLAT = np.zeros((300, 2))


def values_through(lens):
    """What a lens makes of the pixels UV with the inverse depths MEASURED by the depth image."""
    offset, scale = depth_errors(UV, 640, 480, lens.depth_model).T
    return np.column_stack([rays_at(lens.rays, UV), (MEASURED - offset) / scale])


@pytest.mark.parametrize("found", FOUND.values(), ids=FOUND)
def test_pixels_and_depth_images_stay_and_what_they_mean_becomes_the_new_lens_s(found):
    before, after = Lens.of(GIVEN), Lens.of(found, frame_of=GIVEN)
    told = LensChange(before, after).values(values_through(before), FLAT)
    np.testing.assert_allclose(told, values_through(after), atol=2e-5)


def test_there_and_back_is_where_it_was_and_missing_depth_stays_missing():
    there = LensChange(Lens.of(GIVEN), Lens.of(FOUND["bent"], frame_of=GIVEN))
    back = LensChange(there.after, there.before)
    values = values_through(there.before)
    values[::7, 2] = np.nan
    again = back.values(there.values(values, FLAT), FLAT)
    np.testing.assert_allclose(again, values, atol=2e-5)


def test_depth_that_was_read_beside_is_read_where_it_is_by_the_slope_of_the_surface():
    slope = np.full((300, 2), (1e-3, -5e-4))
    shifted = replace(GIVEN, depth=DepthModel(shift_px=(4.0, -2.0)))
    told = LensChange(Lens.of(GIVEN), Lens.of(shifted, frame_of=GIVEN)).values(values_through(Lens.of(GIVEN)), slope)
    uv_depth, _, _ = as_measured(shifted.depth.vector, UV, MEASURED, 640, 480)
    np.testing.assert_allclose(told[:, 2], MEASURED + ((uv_depth - UV) * slope).sum(axis=1), rtol=1e-6)


def test_points_of_a_ray_and_a_depth_move_as_these_do():
    change = LensChange(Lens.of(GIVEN), Lens.of(FOUND["aside"], frame_of=GIVEN))
    values = values_through(change.before)
    points = np.column_stack([values[:, :2], np.ones(300)]) / values[:, 2:]
    new = change.values(values, FLAT)
    expected = np.column_stack([new[:, :2], np.ones(300)]) / new[:, 2:]
    np.testing.assert_allclose(change.points(points), expected, rtol=1e-9)


def test_landmarks_move_as_points_do_in_the_frames_that_measured_them():
    change = LensChange(Lens.of(GIVEN), Lens.of(FOUND["longer"], frame_of=GIVEN))
    values = values_through(change.before)
    points = np.column_stack([values[:, :2], np.ones(300)]) / values[:, 2:]
    T_camera_map = np.array([se3.exp(RNG.normal(size=6)) for _ in points])
    T_map_camera = se3.inverses(T_camera_map)
    in_map = (T_map_camera[:, :3, :3] @ points[:, :, None])[:, :, 0] + T_map_camera[:, :3, 3]
    moved, ratio = change.positions(in_map, FLAT, T_camera_map)
    seen = (T_camera_map[:, :3, :3] @ moved[:, :, None])[:, :, 0] + T_camera_map[:, :3, 3]
    np.testing.assert_allclose(seen, change.points(points), atol=1e-9)
    np.testing.assert_allclose(values[:, 2] * ratio, 1.0 / seen[:, 2], rtol=1e-9)
