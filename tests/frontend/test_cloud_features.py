"""SIFT3D and CSHOT against the Point Cloud Library's own output (pcl_oracle/make_fixture.py), and what they are for."""

import json
import subprocess
import sys
import time
from pathlib import Path

import drawn
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from odom.errors import InputError
from odom.frontend.camera.lens import Lens
from odom.frontend.cloud_features.cloud import Cloud, cloud_of, cube_means
from odom.frontend.cloud_features.cshot import LENGTH, describe, lab
from odom.frontend.cloud_features.matching import cloud_features, match_features
from odom.frontend.cloud_features.neighbourhood import Cells, near
from odom.frontend.cloud_features.reference_frame import reference_frames
from odom.frontend.cloud_features.sift3d import ScaleSpace, sift3d
from odom.geometry import se3
from odom.registration import Pairs, register
from sensors.arena.options import ArenaOptions

FIXTURE = np.load(Path(__file__).parent / "pcl_oracle" / "fixture.npz")
PROVENANCE = json.loads(str(FIXTURE["provenance"]))
SPACE, RADIUS_M = ScaleSpace(**PROVENANCE["sift"]), PROVENANCE["cshot_radius_m"]
CLOUDS = ("laboratory", "bodies")


def part(cloud, name):
    return FIXTURE[f"{cloud}_{name}"].astype(np.float64)


def described(cloud, T=None):
    """The fixture's described points, descriptors of its surface, moved by T."""
    T = np.eye(4) if T is None else T
    points, colors = se3.apply(T, part(cloud, "points")), part(cloud, "colors")
    normals, count = part(cloud, "normals") @ T[:3, :3].T, len(FIXTURE[f"{cloud}_frames"])
    return describe(Cloud(points, colors), normals, points[:count], colors[:count], RADIUS_M)


@pytest.mark.parametrize("cloud", CLOUDS)
def test_key_points_are_those_of_the_point_cloud_library(cloud):
    expected = part(cloud, "keypoints")
    found = sift3d(Cloud(part(cloud, "points"), part(cloud, "colors")), SPACE)
    assert len(expected) > 60
    half_a_voxel_m = SPACE.sigma_m / 2
    ours, theirs = (
        np.column_stack([p, 1e-2 * s]) for p, s in ((found.points, found.sigmas), np.split(expected, [3], 1))
    )
    assert np.mean(KDTree(ours).query(theirs)[0] < half_a_voxel_m) >= 0.95
    assert np.mean(KDTree(theirs).query(ours)[0] < half_a_voxel_m) >= 0.95
    scales = KDTree(found.points).query(expected[:, :3])[1]
    assert np.mean(np.isclose(found.sigmas[scales], expected[:, 3], rtol=1e-4)) >= 0.95


@pytest.mark.parametrize("cloud", CLOUDS)
def test_descriptors_and_frames_are_those_of_the_point_cloud_library(cloud):
    expected = part(cloud, "descriptors")
    found = described(cloud)
    assert found.shape == expected.shape == (50, LENGTH)
    assert min(np.corrcoef(a, b)[0, 1] for a, b in zip(found, expected, strict=True)) >= 0.98
    points, frames = part(cloud, "points"), part(cloud, "frames")
    ours = reference_frames(points[: len(frames)], points, Cells.of(points, RADIUS_M))
    assert np.abs(ours - frames).max() < 1e-3


@settings(max_examples=8)
@given(st.lists(st.floats(-2, 2), min_size=6, max_size=6))
def test_a_descriptor_does_not_change_when_the_cloud_is_moved(xi):
    there = described("bodies", se3.exp(np.array(xi)))
    assert np.median((there * described("bodies")).sum(axis=1)) > 0.9999


@settings(max_examples=20)
@given(st.integers(0, 10_000), st.floats(0.02, 0.6))
def test_near_points_are_those_that_a_k_d_tree_finds(seed, radius_m):
    points = np.random.default_rng(seed).uniform(-1, 1, (300, 3))
    cells, found, squares = Cells.of(points, radius_m), np.empty(300, np.int64), np.empty(300)
    for point in (*points[:5], np.array([3.0, 0.0, 0.0])):
        count = near(point, points, cells, found, squares)
        assert sorted(found[:count]) == sorted(KDTree(points).query_ball_point(point, radius_m))


def test_colours_in_cielab_are_those_of_the_standard():
    # white, black, and pure red: L 53.24, a 80.09, b 67.20 for sRGB under D65
    found = lab(np.array([[255.0, 255.0, 255.0], [0.0, 0.0, 0.0], [255.0, 0.0, 0.0]]))
    assert np.abs(found * (100.0, 120.0, 120.0) - [[100, 0, 0], [0, 0, 0], [53.24, 80.09, 67.20]]).max() < 0.05


def test_cubes_hold_the_means_of_their_points():
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.2, 0.2, (500, 3))
    means = cube_means(points, points, 0.1)
    cubes = {tuple(c): points[(np.floor(points / 0.1) == c).all(axis=1)].mean(axis=0) for c in np.floor(points / 0.1)}
    assert len(means) == len(cubes)
    assert np.allclose(sorted(map(tuple, means)), sorted(map(tuple, cubes.values())))


def plain(color, n=20_000):
    """A wall of one colour, two metres away."""
    rng = np.random.default_rng(1)
    return Cloud(np.column_stack([rng.uniform(-1, 1, (n, 2)), rng.normal(2.0, 0.002, n)]), np.full((n, 3), color))


def test_what_has_no_features_gives_none_and_no_pair():
    nothing = cloud_features(Cloud(np.zeros((0, 3)), np.zeros((0, 3))))
    few = cloud_features(Cloud(np.random.default_rng(0).uniform(1, 2, (10, 3)), np.zeros((10, 3))))
    wall = cloud_features(plain(128.0))
    assert [len(features) for features in (nothing, few, wall)] == [0, 0, 0]
    assert len(match_features(wall, nothing)[0]) == 0


def test_points_that_are_not_finite_are_refused_by_name():
    points = np.ones((5, 3))
    points[2, 1] = np.nan
    with pytest.raises(InputError, match=r"points hold values that are not finite: leave those points out"):
        Cloud(points, np.zeros((5, 3)))
    with pytest.raises(InputError, match=r"colors have shape \(4, 3\)"):
        Cloud(np.ones((5, 3)), np.zeros((4, 3)))


def cloud_at(options, index):
    shot = drawn.frame(options, index)
    return cloud_of(shot.rgb, shot.depth_mm, Lens.of(options.camera).rays), shot.T_world_camera


@pytest.mark.parametrize("sensor", ["kinect1", "kinect2"])
def test_two_looks_of_a_kinect_are_registered_by_key_points_alone(sensor):
    options = ArenaOptions(sensor=sensor)
    (source, T_world_source), (target, T_world_target) = (cloud_at(options, index) for index in (328, 320))
    ours, theirs = cloud_features(source), cloud_features(target)
    a, b = match_features(ours, theirs)
    sigmas = np.hypot(ours.sigmas[a], theirs.sigmas[b])
    noise = np.eye(3) * (0.5 * sigmas[:, None, None]) ** 2
    found = register(Pairs(ours.points[a], theirs.points[b], None, noise))
    error = se3.log(se3.inverse(found.T_target_source) @ se3.inverse(T_world_target) @ T_world_source)
    assert np.linalg.norm(error[:3]) < 0.05
    assert np.degrees(np.linalg.norm(error[3:])) < 3.0


@pytest.mark.alone
def test_a_kinects_cloud_takes_at_most_two_seconds_of_one_core():
    cloud, _ = cloud_at(ArenaOptions(), 320)
    cloud_features(cloud)
    begun = time.process_time()
    assert len(cloud_features(cloud)) > 100
    assert time.process_time() - begun <= 2.0


def test_the_odometry_does_not_load_it():
    code = (
        "import sys, odom.backend, odom.service.odometry_process; print('odom.frontend.cloud_features' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "False"
