"""Images of small cameras are enlarged, those of large ones reduced: the scaled camera sees the same."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom, stroll
from sensor_models import sensor_model, view_of

from odom.frame import Camera, DepthModel
from odom.frame.depth_model import as_measured
from odom.frontend.camera.lens import Lens, rays_at
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.image_scale import (
    own_uv,
    scale_for,
    scale_of,
    scaled_camera,
    scaled_depth,
    scaled_image,
    scaled_mask,
    scaled_uv,
)
from odom.frontend.features.images import FrameImages
from odom.frontend.features.measurement import measure

DEPTH = DepthModel((1.0, -2.0), (3.0, 0.5), (0.01, 0.0, 0.02, 0.0, 0.0, 0.01), (1.02, 0.01, 0, 0, 0, 0), (0.02, 0.01))
BENT = Camera(320, 240, 262.0, 264.0, 158.0, 121.0, (0.1, -0.2, 1e-3, 2e-3, 0.05), DEPTH)


@pytest.mark.parametrize(
    ("shape", "scale"),
    [
        *[((480, 640, 3), 1), ((360, 480), 1), ((480, 300), 1), ((959, 1279), 1)],
        *[((240, 320), 2), ((359, 479), 2), ((120, 160), 4), ((64, 64), 4)],
        *[((720, 1280), 0.5), ((1080, 1920, 3), 0.5), ((2160, 3840), 0.25)],
    ],
)
def test_images_are_brought_between_480_and_1280_px(shape, scale):
    assert scale_for(shape) == scale


def test_images_of_a_usual_size_are_the_very_ones_that_came():
    camera, image = Camera(640, 480, 525.0, 525.0, 319.5, 239.5), np.zeros((480, 640), np.uint8)
    assert scaled_camera(camera) is camera
    assert scaled_image(image, 1) is image
    assert scaled_depth(image, 1) is image
    assert scaled_mask(image, 1) is image
    uv = np.zeros((1, 2))
    assert own_uv(uv, 1) is uv


def _sized(times: float) -> Camera:
    sizes = {name: times * getattr(BENT, name) for name in ("fx", "fy", "cx", "cy")}
    return replace(BENT, width=int(320 * times), height=int(240 * times), **sizes)


@pytest.mark.parametrize("camera", [BENT, _sized(0.5), _sized(4), _sized(8)])
def test_the_scaled_camera_sees_the_same_at_the_same_places(camera):
    large, factor = scaled_camera(camera), scale_of(camera)
    assert (large.width, large.height) == (640, 480)
    uv = np.random.default_rng(1).uniform((1, 1), (camera.width - 2, camera.height - 2), (50, 2)).round()
    there = scaled_uv(uv, factor)
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
    large = scaled_image(image, factor)
    assert large.shape == (60 * factor, 80 * factor)
    V, U = np.mgrid[: 60 * factor, : 80 * factor]
    at = own_uv(np.stack([U, V], axis=-1).reshape(-1, 2).astype(np.float64), factor).reshape(*large.shape, 2)
    inside = (slice(2 * factor, -2 * factor),) * 2
    assert np.abs(large - (40.0 + at[..., 0] + 2.0 * at[..., 1]))[inside].max() <= 1.0
    deep = scaled_depth(image.astype(np.uint16), factor)
    assert deep.dtype == np.uint16
    np.testing.assert_array_equal(deep, image[np.rint(at[..., 1]).astype(int), np.rint(at[..., 0]).astype(int)])


def test_a_view_measures_what_the_small_camera_saw():
    frame = PaintedRoom(seed=4).frame(SMALL, 0, stroll(1.0))
    mask = np.zeros((240, 320), dtype=np.bool_)
    mask[100:140, 40:80] = True
    view = replace(view_of(frame), may_move=scaled_mask(mask, 2))
    assert view.images.full.shape == view.depth_mm.shape == (480, 640)
    uv = np.array([[60.0, 120.0], [200.0, 60.0], [260.0, 180.0]])
    assert view.stands(scaled_uv(uv, 2)).tolist() == [False, True, True]
    seen = measure(view, sensor_model(SMALL), scaled_uv(uv, 2), np.zeros((3, 3)), np.zeros(6))
    np.testing.assert_allclose(seen.values[:, :2], rays_at(Lens.of(SMALL).rays, uv), atol=1e-6)
    column, row = uv.astype(int).T
    np.testing.assert_allclose(seen.values[:, 2], 1000.0 / frame.depth_mm[row, column], rtol=0.01)


@pytest.mark.parametrize("factor", [2, 4])
@pytest.mark.parametrize("noise", [2.0, 6.0])
def test_enlarged_noise_makes_no_corners(factor, noise):
    grey = 128.0 + noise * np.random.default_rng(3).normal(size=(480 // factor, 640 // factor))
    images = FrameImages.of(np.rint(grey).astype(np.uint8))
    assert images.scale == factor
    assert len(detect_corners(images.full, np.zeros((0, 2)), 22, images.enlarged_from)) < 3
    assert len(detect_corners(images.full, np.zeros((0, 2)), 22)) > 100  # which the enlarged image's own noise hides


def test_a_reduced_image_shows_the_means_of_its_blocks_and_an_odd_row_is_left_out():
    image = np.random.default_rng(2).integers(0, 256, (721, 1281), dtype=np.uint8)
    small = scaled_image(image, 0.5)
    assert small.shape == (360, 640)
    means = image[:720, :1280].reshape(360, 2, 640, 2).mean(axis=(1, 3))
    assert np.abs(small - means).max() <= 0.5
    camera = scaled_camera(Camera(1281, 721, 1000.0, 1000.0, 640.0, 360.0))
    assert (camera.width, camera.height) == (640, 360)
    assert (camera.cx, camera.cy) == (319.75, 179.75)


def test_reduced_depth_is_that_of_one_surface():
    blocks = [[1000, 1002, 1004, 1006], [0, 0, 0, 1500], [800, 2000, 2004, 0], [0, 0, 0, 0], [65535] * 4]
    depth = np.array(blocks, np.uint16).reshape(5, 2, 2).transpose(1, 0, 2).reshape(2, 10)
    assert scaled_depth(depth, 0.5).tolist() == [[1003, 1500, 800, 0, 65535]]
    around = np.pad(depth.reshape(2, 5, 2), ((1, 1), (0, 0), (1, 1)), constant_values=3000).reshape(4, 20)
    assert scaled_depth(around, 0.25).tolist() == scaled_depth(depth, 0.5).tolist()


def test_one_marked_pixel_marks_its_block():
    mask = np.zeros((7, 9), np.bool_)
    mask[3, 4] = True
    assert np.argwhere(scaled_mask(mask, 0.5)).tolist() == [[1, 2]]
    assert scaled_mask(mask, 0.5).shape == (3, 4)


def test_depth_of_a_reduced_view_is_where_the_large_camera_saw_it():
    v, u = np.mgrid[:960, :1280].astype(np.float64)
    depth = np.rint(1000.0 + 0.5 * u + 0.3 * v).astype(np.uint16)
    small = scaled_depth(depth, 0.5)
    V, U = np.mgrid[:480, :640].astype(np.float64)
    at = own_uv(np.stack([U, V], axis=-1).reshape(-1, 2), 0.5).reshape(480, 640, 2)
    np.testing.assert_allclose(small, 1000.0 + 0.5 * at[..., 0] + 0.3 * at[..., 1], atol=0.6)
