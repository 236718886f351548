"""Depth images whose measured pixels lie apart are filled to planes; dense ones stay as they are."""

import numpy as np
import pytest

from odom.frontend.features.depth_plane import PLANE_LIMITS, read_planes
from odom.frontend.features.sparse_depth import dense_depth, is_sparse, without_gaps

V, U = np.mgrid[0:240, 0:320].astype(np.float64)
WALL_MM = np.rint(1000.0 / (0.6 + 0.0008 * U - 0.0005 * V)).astype(np.uint16)
PLACES = np.random.default_rng(2).uniform((30, 30), (290, 210), (200, 2))


def at_random(share, seed=1):
    return np.random.default_rng(seed).random(WALL_MM.shape) < share


def every(columns, rows):
    return (U % columns == columns - 1) & (V % rows == rows - 1)


PATTERNS = {
    "two of five": at_random(0.4),
    "one of twenty": at_random(0.05),
    "every second both ways": every(2, 2),
    "every fourth both ways": every(4, 4),
    "a lidar's lines": every(1, 16),
    "every third column": every(3, 1),
}


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_plane_is_read_where_few_of_its_pixels_are_measured(pattern):
    measured = PATTERNS[pattern]
    depth_mm = WALL_MM * measured
    assert is_sparse(depth_mm)
    found = read_planes(dense_depth(depth_mm, 1.0), PLACES, PLANE_LIMITS)
    is_read = np.isfinite(found[:, 0])
    assert is_read.mean() > (0.3 if pattern == "a lidar's lines" else 0.95)  # these are filled to half of the gaps
    true = 0.6 + 0.0008 * PLACES[:, 0] - 0.0005 * PLACES[:, 1]
    assert np.abs(found[:, 0] / true - 1.0)[is_read].max() < 0.03  # the noise of such depth: slope times distance
    assert np.abs(np.mean(found[:, 0] / true - 1.0, where=is_read)) < 0.001


@pytest.mark.parametrize("share", [1.0, 0.9, 0.65])
def test_a_dense_image_with_holes_is_the_very_one_that_came(share):
    depth_mm = WALL_MM * at_random(share)
    depth_mm[100:180, 50:130] = 0
    assert not is_sparse(depth_mm)
    assert without_gaps(depth_mm) is depth_mm
    assert dense_depth(depth_mm, 1.0) is depth_mm


def test_an_image_without_depth_stays_without():
    nothing = np.zeros_like(WALL_MM)
    assert not dense_depth(nothing, 1.0).any()
    one = nothing.copy()
    one[8, 7] = 900
    assert np.unique(without_gaps(one)).tolist() == [0, 900]


@pytest.mark.parametrize("measured", PATTERNS.values(), ids=PATTERNS)
def test_no_depth_is_made_up_and_none_that_was_measured_changes(measured):
    two_surfaces = np.where(U < 160, 900, 2400).astype(np.uint16)
    depth_mm = two_surfaces * measured
    found = without_gaps(depth_mm)
    assert set(np.unique(found).tolist()) <= {0, 900, 2400}
    np.testing.assert_array_equal(found[measured], depth_mm[measured])
    away = np.abs(U - 160) > 9
    assert np.isin(found[away & (found > 0)], (900, 2400)).all()
    assert (found == two_surfaces)[away & (found > 0)].all()


def test_holes_wider_than_the_gaps_stay_holes():
    depth_mm = WALL_MM * every(3, 3)
    depth_mm[80:160, 100:200] = 0
    found = without_gaps(depth_mm)
    assert not found[86:154, 106:194].any()
    assert (found[10:70, 10:300] > 0).all()


def test_all_pixels_of_large_images_are_used_and_small_ones_are_filled_before_they_are_enlarged():
    large = np.kron(WALL_MM, np.ones((4, 4), np.uint16)) * (np.kron(every(2, 2), np.eye(4)[::-1]) > 0)
    reduced = dense_depth(large.astype(np.uint16), 0.25)
    assert reduced.shape == WALL_MM.shape
    assert (reduced > 0).mean() > 0.98
    enlarged = dense_depth(WALL_MM * every(4, 4), 2.0)
    assert enlarged.shape == (480, 640)
    np.testing.assert_array_equal(enlarged[::2, ::2], without_gaps(WALL_MM * every(4, 4)))


@pytest.mark.parametrize("share", [0.005, 0.01, 0.05, 0.2, 0.5])
def test_a_sensors_noise_is_taken_for_no_surface(share):
    depths = np.random.default_rng(3).integers(500, 4000, WALL_MM.shape).astype(np.uint16)
    depth_mm = depths * at_random(share)
    assert is_sparse(depth_mm)
    assert without_gaps(depth_mm) is depth_mm
