"""Images of small cameras are enlarged: the enlarged camera sees the same, and large images stay as they are."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom, stroll
from sensor_models import sensor_model, view_of

from odom.frame import Camera, DepthModel
from odom.frame.depth_model import as_measured
from odom.frontend.camera.lens import Lens, rays_at
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.enlargement import (
    enlarged_camera,
    enlarged_image,
    enlarged_uv,
    factor_for,
    factor_of,
    own_uv,
    repeated,
)
from odom.frontend.features.images import FrameImages
from odom.frontend.features.measurement import measure

DEPTH = DepthModel((1.0, -2.0), (3.0, 0.5), (0.01, 0.0, 0.02, 0.0, 0.0, 0.01), (1.02, 0.01, 0, 0, 0, 0), (0.02, 0.01))
BENT = Camera(320, 240, 262.0, 264.0, 158.0, 121.0, (0.1, -0.2, 1e-3, 2e-3, 0.05), DEPTH)


@pytest.mark.parametrize(
    ("shape", "factor"),
    [((480, 640, 3), 1), ((360, 480), 1), ((480, 300), 1), ((240, 320), 2), ((359, 479), 2), ((120, 160), 4)],
)
def test_images_below_480_px_are_enlarged_twice_or_four_times(shape, factor):
    assert factor_for(shape) == factor


def test_large_images_are_the_very_ones_that_came():
    camera, image = Camera(640, 480, 525.0, 525.0, 319.5, 239.5), np.zeros((480, 640), np.uint8)
    assert enlarged_camera(camera) is camera
    assert enlarged_image(image, 1) is image
    assert repeated(image, 1) is image
    uv = np.zeros((1, 2))
    assert own_uv(uv, 1) is uv


@pytest.mark.parametrize("camera", [BENT, replace(BENT, width=160, height=120, fx=131.0, fy=132.0, cx=79.0, cy=60.0)])
def test_the_enlarged_camera_sees_the_same_at_the_same_places(camera):
    large, factor = enlarged_camera(camera), factor_of(camera)
    assert (large.width, large.height) == (640, 480)
    uv = np.random.default_rng(1).uniform((1, 1), (camera.width - 2, camera.height - 2), (50, 2)).round()
    there = enlarged_uv(uv, factor)
    np.testing.assert_allclose(own_uv(there, factor), uv, atol=1e-12)
    rays = rays_at(Lens.of(camera).rays, uv)
    np.testing.assert_allclose(rays_at(Lens.of(large).rays, there), rays, atol=2e-5)
    near = np.linspace(0.3, 2.0, len(uv))
    own = as_measured(camera.depth.vector, uv, near, camera.width, camera.height)
    found = as_measured(large.depth.vector, there, near, large.width, large.height)
    np.testing.assert_allclose(own_uv(found[0], factor), own[0], atol=1e-9)
    np.testing.assert_allclose(found[1], own[1], atol=1e-12)


@pytest.mark.parametrize("factor", [2, 4])
def test_what_an_image_shows_is_where_the_enlarged_camera_sees_it(factor):
    v, u = np.mgrid[:60, :80].astype(np.float64)
    image = np.rint(40.0 + u + 2.0 * v).astype(np.uint8)
    large = enlarged_image(image, factor)
    assert large.shape == (60 * factor, 80 * factor)
    V, U = np.mgrid[: 60 * factor, : 80 * factor]
    at = own_uv(np.stack([U, V], axis=-1).reshape(-1, 2).astype(np.float64), factor).reshape(*large.shape, 2)
    inside = (slice(2 * factor, -2 * factor),) * 2
    assert np.abs(large - (40.0 + at[..., 0] + 2.0 * at[..., 1]))[inside].max() <= 1.0
    deep = repeated(image.astype(np.uint16), factor)
    assert deep.dtype == np.uint16
    np.testing.assert_array_equal(deep, image[np.rint(at[..., 1]).astype(int), np.rint(at[..., 0]).astype(int)])


def test_a_view_measures_what_the_small_camera_saw():
    frame = PaintedRoom(seed=4).frame(SMALL, 0, stroll(1.0))
    mask = np.zeros((240, 320), dtype=np.bool_)
    mask[100:140, 40:80] = True
    view = replace(view_of(frame), may_move=repeated(mask, 2))
    assert view.images.full.shape == view.depth_mm.shape == (480, 640)
    uv = np.array([[60.0, 120.0], [200.0, 60.0], [260.0, 180.0]])
    assert view.stands(enlarged_uv(uv, 2)).tolist() == [False, True, True]
    seen = measure(view, sensor_model(SMALL), enlarged_uv(uv, 2), np.zeros((3, 3)), np.zeros(6))
    np.testing.assert_allclose(seen.values[:, :2], rays_at(Lens.of(SMALL).rays, uv), atol=1e-6)
    column, row = uv.astype(int).T
    np.testing.assert_allclose(seen.values[:, 2], 1000.0 / frame.depth_mm[row, column], rtol=0.01)


@pytest.mark.parametrize("factor", [2, 4])
@pytest.mark.parametrize("noise", [2.0, 6.0])
def test_enlarged_noise_makes_no_corners(factor, noise):
    grey = 128.0 + noise * np.random.default_rng(3).normal(size=(480 // factor, 640 // factor))
    images = FrameImages.of(np.rint(grey).astype(np.uint8))
    assert images.factor == factor
    assert len(detect_corners(images.full, np.zeros((0, 2)), 22, images.own)) < 3
    assert len(detect_corners(images.full, np.zeros((0, 2)), 22)) > 100  # which the enlarged image's own noise hides
