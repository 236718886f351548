"""Depth images aligned by their surfaces: right where these have shape, and honest where they have none."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from painted_room import SMALL, START, PaintedRoom
from sensor_models import sensor_model, view_of

from odom.frame import Camera, RgbdFrame
from odom.frontend.features.surface import Surfaces
from odom.frontend.matching.surface_alignment import SurfaceAlignment, align_surfaces
from odom.geometry import se3
from odom.geometry.arrays import Array

SENSOR, AT_REST = sensor_model(SMALL), np.zeros(6)
ROOM = PaintedRoom(half_size=(0.8, 0.7, 1.3))
"""A small one, so that a view shows several walls."""
CORNER = se3.exp(np.array([0.1, 0.05, 0.2, 0.5, 0.6, 0.2]))
"""T_room_camera of a camera that looks into one."""
ABOUT_STILL = np.diag([0.05**2] * 3 + [0.1**2] * 3)


def surfaces(depth_mm: Array) -> Surfaces:
    grey = np.full(depth_mm.shape, 120, np.uint8)
    frame = RgbdFrame(0, START, grey, START, depth_mm.astype(np.uint16))
    return Surfaces.of(view_of(frame), SENSOR, AT_REST)


def seen_from(T_room_camera: Array) -> Surfaces:
    return surfaces(ROOM.render(SMALL, T_room_camera)[1])


def moved(xi: Array) -> tuple[SurfaceAlignment, Array]:
    """The alignment of two views of the corner that lie `xi` apart, expected at rest, and its error (6)."""
    T = se3.exp(xi)
    aligned = align_surfaces(seen_from(CORNER @ T), seen_from(CORNER), np.eye(4), ABOUT_STILL)
    return aligned, se3.log(se3.inverse(aligned.T_target_source) @ T)


@settings(max_examples=15, deadline=None)
@given(xi=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6))
def test_a_motion_in_a_corner_is_found_to_a_few_millimetres(xi: list[float]) -> None:
    aligned, error = moved(np.array(xi) * np.repeat([0.03, 0.05], 3))
    assert aligned.has_shape
    assert aligned.overlap > 0.6
    assert np.linalg.norm(error[:3]) < 0.004
    assert np.linalg.norm(error[3:]) < 0.004
    assert error @ np.linalg.solve(aligned.covariance, error) < 6.0


@pytest.mark.parametrize("xi", [(0.02, 0, 0, 0, 0, 0), (0, 0.03, 0, 0, 0, 0), (0, 0, 0, 0, 0, 0.05)])
def test_along_a_wall_and_about_its_normal_the_motion_stays_as_expected(xi: tuple[float, ...]) -> None:
    wall = np.full((SMALL.height, SMALL.width), 1000)
    aligned = align_surfaces(surfaces(wall), surfaces(wall), se3.exp(np.array(xi)), ABOUT_STILL)
    assert not aligned.has_shape
    kept = np.array(xi) != 0.0
    np.testing.assert_allclose(se3.log(aligned.T_target_source), xi, atol=1e-6)
    sigma = np.sqrt(np.diag(aligned.covariance))
    assert (sigma[kept] > 0.5).all()
    assert sigma[2] < 0.02


def test_towards_a_wall_the_motion_is_found_all_the_same() -> None:
    far, near = (surfaces(np.full((SMALL.height, SMALL.width), mm)) for mm in (1000, 960))
    aligned = align_surfaces(near, far, np.eye(4), ABOUT_STILL)
    assert not aligned.has_shape
    np.testing.assert_allclose(se3.log(aligned.T_target_source), [0, 0, 0.04, 0, 0, 0], atol=0.002)


@pytest.mark.parametrize(("width", "height"), [(640, 480), (848, 480), (512, 424)])
def test_points_find_the_planes_of_their_cells_where_an_image_has_no_whole_number_of_square_ones(
    width: int, height: int
) -> None:
    """Every second row of cells shows a wall: points near the lower ends of those cells are on it."""
    camera = Camera(width, height, 500.0, 500.0, (width - 1) / 2, (height - 1) / 2)
    depth = np.full((height, width), 1000, np.uint16)
    frame = RgbdFrame(0, START, np.full(depth.shape, 120, np.uint8), START, depth)
    wall = Surfaces.of(view_of(frame), sensor_model(camera), AT_REST)
    rays, planes = wall.rays.copy(), wall.planes.copy()
    rays[..., 1] += 0.45 * height / len(rays) / 500.0
    rays[1::2], planes[1::2] = np.nan, np.nan
    shown = np.isfinite(rays[::2]).all(axis=2)
    aligned = align_surfaces(replace(wall, rays=rays), replace(wall, planes=planes), np.eye(4), ABOUT_STILL)
    assert shown.mean() > 0.8
    assert aligned.overlap == 1.0


@pytest.mark.parametrize("depth_mm", [0, 65535])
def test_depth_that_shows_nothing_says_nothing(depth_mm: int) -> None:
    blind = surfaces(np.full((SMALL.height, SMALL.width), depth_mm))
    for source, target in ((blind, seen_from(CORNER)), (seen_from(CORNER), blind), (blind, blind)):
        aligned = align_surfaces(source, target, np.eye(4), ABOUT_STILL)
        assert not aligned.has_shape
        assert aligned.overlap == 0.0
        np.testing.assert_allclose(aligned.T_target_source, np.eye(4), atol=1e-12)
        assert np.linalg.eigvalsh(aligned.covariance)[0] > 0.01


def test_a_body_before_the_corner_hardly_moves_the_camera() -> None:
    """It fills a fifth of the view and goes 20 cm aside."""
    depth = ROOM.render(SMALL, CORNER)[1].astype(np.int64)
    first, second = depth.copy(), depth.copy()
    first[60:180, 40:168], second[60:180, 100:228] = 700, 700
    aligned = align_surfaces(surfaces(second), surfaces(first), np.eye(4), ABOUT_STILL)
    assert np.linalg.norm(se3.log(aligned.T_target_source)) < 0.02


def test_a_body_that_has_come_lies_before_what_was_seen_and_one_that_has_gone_does_not() -> None:
    depth = ROOM.render(SMALL, CORNER)[1].astype(np.int64)
    hidden = depth.copy()
    hidden[60:180, 40:168] = 500
    scene, with_body = surfaces(depth), surfaces(hidden)
    body = 120 * 128 / depth.size
    assert align_surfaces(with_body, scene, np.eye(4), ABOUT_STILL).in_front == pytest.approx(body, rel=0.2)
    assert align_surfaces(scene, with_body, np.eye(4), ABOUT_STILL).in_front < 0.01
    assert moved(np.array([0.02, 0.01, 0.0, 0.0, 0.02, 0.0]))[0].in_front < 0.01


def test_surfaces_further_apart_than_noise_explains_do_not_fit() -> None:
    depth = ROOM.render(SMALL, CORNER)[1].astype(np.float64)
    rough = depth * (1.0 + 0.02 * np.sin(np.arange(depth.shape[1]) / 4.0))
    fits, apart = (align_surfaces(surfaces(d), surfaces(depth), np.eye(4), ABOUT_STILL) for d in (depth, rough))
    assert fits.misfit < 1.0
    assert apart.misfit > 2.0


def test_every_point_of_a_plane_is_at_one_on_its_vector() -> None:
    seen = seen_from(CORNER)
    known = np.isfinite(seen.planes[..., 2]) & (seen.rays[..., 2] > 0.0)
    rays, planes = seen.rays[known], seen.planes[known]
    ahead = np.column_stack([rays[:, :2], np.ones(len(rays))])
    assert known.mean() > 0.7
    np.testing.assert_allclose(np.einsum("ij,ij->i", ahead, planes), rays[:, 2], atol=1e-9)
