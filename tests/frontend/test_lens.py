from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from odom.errors import ConfigError
from odom.frame import Camera
from odom.frontend.camera.lens import Lens, rays_at
from odom.frontend.camera.rays import grid_over, rays_of
from odom.frontend.features.shutter_compensation import depth_errors
from odom.geometry.rotations import turn_onto

small = st.floats(-0.003, 0.003)


@st.composite
def cameras(draw):
    width, height = draw(st.sampled_from([(640, 480), (320, 240), (320, 180), (321, 239)]))
    focal = draw(st.floats(0.75, 1.4)) * width
    plumb_bob = (draw(st.floats(-0.12, 0.25)), draw(st.floats(-0.05, 0.1)), draw(small), draw(small))
    k3 = draw(st.floats(-0.02, 0.02))
    rational = tuple(draw(st.floats(-0.03, 0.03)) for _ in range(3))
    distortion = draw(st.sampled_from([(), plumb_bob, (*plumb_bob, k3), (*plumb_bob, k3, *rational)]))
    centre = width / 2 + draw(st.floats(-20, 20)), height / 2 + draw(st.floats(-20, 20))
    return Camera(width, height, focal, focal * draw(st.floats(0.97, 1.03)), *centre, distortion)


@settings(max_examples=25)
@given(cameras(), st.integers(0, 1000))
def test_projection_undoes_the_ray_of_a_pixel_for_every_lens(camera, seed):
    lens = Lens.of(camera)
    rng = np.random.default_rng(seed)
    uv = rng.uniform((1, 1), (camera.width - 2, camera.height - 2), (200, 2))
    z = rng.uniform(0.3, 8.0, (200, 1))
    points = np.column_stack([rays_at(lens.rays, uv) * z, z])
    seen = lens.project(points, np.eye(4))
    np.testing.assert_allclose(seen[:, :2], uv, atol=0.01)
    np.testing.assert_allclose(seen[:, 2:], z, rtol=1e-9)


@pytest.mark.parametrize("distortion", [(-0.3, 0.1, 0.0, 0.0, -0.012), (-0.32, 0.12, 0.0, 0.0, -0.02)])
def test_the_rays_of_single_pixels_are_those_of_the_table_in_the_corners_of_a_wide_lens_too(distortion):
    camera = Camera(640, 480, 430.0, 430.0, 319.5, 239.5, distortion)
    uv = grid_over(camera)
    rays = rays_of(camera, uv)
    away_px = 430.0 * (rays[:, :2] / rays[:, 2:] - rays_at(Lens.of(camera).rays, uv))
    assert np.abs(away_px).max() < 1e-3


def test_points_outside_the_margin_or_behind_are_not_in_the_image():
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
    lens = Lens.of(camera)
    points = np.array([[0, 0, 2], [0, 0, -2], [0, 0, 0.05], [5, 0, 2], [-1.2, 0, 2], [0, 0.9, 2]], dtype=np.float64)
    seen = lens.project(points, np.eye(4), 8.0)
    assert np.isfinite(seen[:, 0]).tolist() == [True, False, False, False, False, False]


@pytest.mark.parametrize("told", [None, Camera(640, 480, 525.0, 525.0, 300.0, 250.0)], ids=["own", "turned"])
@pytest.mark.parametrize(
    "distortion", [(-0.2, 0.0, 0.0, 0.0, 0.0), (-0.4, 0.12, 0.001, -0.001, -0.01), (0.2, -0.4, 0.0, 0.0, 0.0)]
)
def test_a_strong_lens_does_not_fold_points_from_far_outside_into_the_image(distortion, told):
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5, distortion)
    lens = Lens.of(camera, told)
    uv = np.stack(np.meshgrid(np.linspace(0, 639, 9), np.linspace(0, 479, 7)), axis=-1).reshape(-1, 2)
    rays = rays_at(lens.rays, uv)
    border = rays[(uv == 0).any(axis=1) | (uv == (639, 479)).any(axis=1)]
    outside = (border[:, None] * np.linspace(1.1, 4.0, 100)[:, None]).reshape(-1, 2)

    def seen(xy):
        points = 2.0 * np.column_stack([xy, np.ones(len(xy))])
        return lens.project(points, np.eye(4), -0.01)[:, :2]

    np.testing.assert_allclose(seen(rays), uv, atol=0.01)
    assert np.isnan(seen(outside)).all()


def test_a_barrel_lens_does_not_fold_points_from_far_outside_into_the_image():
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5, (-0.3, 0.0, 0.0, 0.0, 0.0))
    lens = Lens.of(camera)
    x = np.linspace(0.75, 6.0, 200)
    points = np.column_stack([2 * x, np.zeros(200), np.full(200, 2.0)])
    seen = lens.project(points, np.eye(4))
    assert np.isnan(seen[:, 0]).all()


def test_the_lens_of_an_equal_camera_is_not_computed_again():
    lens = Lens.of(Camera(64, 48, 52.0, 52.0, 31.5, 23.5, (0.1, 0.0, 0.0, 0.0)))
    assert Lens.of(Camera(64, 48, 52.0, 52.0, 31.5, 23.5, (0.1, 0.0, 0.0, 0.0))) is lens
    assert Lens.of(Camera(64, 48, 53.0, 52.0, 31.5, 23.5, (0.1, 0.0, 0.0, 0.0))) is not lens


def test_a_model_with_terms_that_projection_does_not_have_is_refused():
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5, (*[0.0] * 8, 0.01, 0.0, -0.01, 0.0))
    with pytest.raises(ConfigError):
        Lens.of(camera)


@settings(max_examples=max(8, settings.default.max_examples // 4))
@given(cameras(), st.integers(0, 1000))
def test_a_lens_told_in_the_frame_of_another_camera_sees_nearly_as_that_one_and_projects_to_its_own_pixels(
    camera, seed
):
    given = replace(camera, cx=camera.width / 2, cy=camera.height / 2, distortion=())
    plain, own, told = Lens.of(given), Lens.of(camera), Lens.of(camera, frame_of=given)
    rng = np.random.default_rng(seed)
    uv = rng.uniform((1, 1), (camera.width - 2, camera.height - 2), (200, 2))
    z = rng.uniform(0.3, 8.0, (200, 1))
    points = np.column_stack([rays_at(told.rays, uv) * z, z])
    seen = told.project(points, np.eye(4))
    np.testing.assert_allclose(seen[:, :2], uv, atol=0.01)
    away = [np.abs(np.median(lens.rays - plain.rays, axis=(0, 1))).max() for lens in (own, told)]
    assert away[1] <= away[0] + 1e-3
    uv = grid_over(camera)
    rays = np.column_stack([rays_at(told.rays, uv), np.ones(len(uv))])
    turn = turn_onto(rays / np.linalg.norm(rays, axis=1, keepdims=True), rays_of(given, uv))
    np.testing.assert_allclose(turn, np.eye(3), atol=1e-5)  # no rotation brings them nearer
    np.testing.assert_allclose(told.R_own_rays @ told.R_own_rays.T, np.eye(3), atol=1e-12)


def test_depth_along_a_turned_axis_is_the_distance_along_it():
    camera = Camera(640, 480, 525.0, 520.0, 326.0, 262.0)
    given = replace(camera, cx=319.5, cy=239.5)
    told = Lens.of(camera, frame_of=given)
    uv = np.array([[60.0, 40.0], [600.0, 60.0], [320.0, 240.0], [50.0, 430.0]])
    own = np.column_stack([rays_at(Lens.of(camera).rays, uv), np.ones(4)]) * 2.5
    turned = own @ told.R_own_rays
    np.testing.assert_allclose(turned[:, :2] / turned[:, 2:], rays_at(told.rays, uv), atol=1e-5)
    offset, scale = depth_errors(uv, 640, 480, told.depth_model).T
    np.testing.assert_allclose((1 / 2.5 - offset) / scale, 1.0 / turned[:, 2], rtol=1e-3)
