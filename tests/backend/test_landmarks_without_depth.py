"""Corners without depth become landmarks whose depth parallax tells: beyond a sensor's range the camera goes on."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_up_scene import blank_view, noisy, points_ahead, project
from painted_room import AT_ONCE, SMALL, PaintedRoom, stroll
from running import Ran, check_sanity, run
from sensor_models import sensor_model

from odom.backend import Odometry, State
from odom.backend.map.corners import Corners
from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.map.map import Map
from odom.backend.map.memory import details_of
from odom.backend.map.shown import cloud_of
from odom.backend.mapping import map_adjustment
from odom.backend.mapping.depth_filter import refine_depths
from odom.backend.tracking.found_landmarks import FoundLandmarks
from odom.backend.tracking.pose_solver import fit_pose
from odom.backend.tracking.quality import judge_pose
from odom.evaluation.robustness.depth import out_of_range
from odom.evaluation.robustness.verdict import verdict
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.features.assumed_depth import with_assumed_depth
from odom.frontend.features.measurement import Measurements
from odom.frontend.matching.landmark_search import LandmarkMatches
from odom.geometry import se3

EXACT, SENSOR, UPRIGHT = 1e-10 * np.eye(6), sensor_model(SMALL), np.zeros(2)
ASIDE = se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.8, 0.0]))
"""T_room_camera of a camera that looks aside: one wall is nearer than the other."""


def measured(rng, points, T_camera_map, has_depth):
    """What a camera measures of points, with depth of those that have it (n)."""
    values, variances = noisy(rng, project(T_camera_map, points))
    values[~has_depth, 2] = np.nan
    n = len(points)
    return Measurements(values, np.zeros((n, 3, 3)), variances, np.zeros((n, 2)))


def uv_of(points):
    return np.full((len(points), 2), 30.0)


def map_of(rng, points, has_depth):
    """A map whose first key frame, at the origin, shows the points."""
    map_ = Map()
    keyframe = map_.add_keyframe(blank_view(0), np.eye(4), MeasuredLandmarks.nothing(), ShutterTiming(), None, EXACT)
    seen = measured(rng, points, np.eye(4), has_depth)
    seen.values[:, :2] = project(np.eye(4), points)[:, :2]  # there patches are cut: where they are is where they lie
    map_.add_corners(keyframe, blank_view(0), Corners(uv_of(points), seen), np.zeros(2))
    return map_


def seen_from(rng, points, T_camera_map, has_depth):
    rows = np.arange(len(points))
    return MeasuredLandmarks(rows, uv_of(points), measured(rng, points, T_camera_map, has_depth))


def inverse_depths(map_, n):
    """Inverse depth of the first n landmarks, as the first key frame sees it, and its standard deviation."""
    w = 1.0 / map_.landmarks.position[:n, 2]
    return w, w**2 * np.sqrt(map_.landmarks.covariance[:n, 2, 2])


def walk_aside():
    """Poses (T_room_camera) and frames of four seconds along the nearer wall."""
    room, poses = PaintedRoom(), [ASIDE @ stroll(3.0 * k / 30.0) for k in range(120)]
    return poses, [room.frame(SMALL, k, T) for k, T in enumerate(poses)]


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 0.8, 0.6), (0.3, 0.2, 1.0)])
def test_their_depth_becomes_known_as_the_camera_moves_as_well_as_is_said(direction):
    rng, none = np.random.default_rng(0), np.zeros(300, dtype=bool)
    points = points_ahead(rng, 300)
    points[200:] *= 30.0 / points[200:, 2:]
    map_ = map_of(rng, points, none)
    for k in range(1, 31):
        T = se3.inverse(se3.exp(np.array([*(0.01 * k * np.array(direction)), 0.0, 0.003 * k, 0.0])))
        refine_depths(map_, seen_from(rng, points, T, none), T, EXACT, UPRIGHT)
    w, sigma = inverse_depths(map_, 300)
    squares = ((w - 1.0 / points[:, 2]) / sigma) ** 2
    assert squares[:200].mean() < 1.5
    assert squares[200:].mean() < 2.0
    if direction[0] == 1.0:
        assert np.abs(w * points[:, 2] - 1.0)[:200].max() < 0.05
        assert not map_.landmarks.is_vague(np.arange(200)).any()
        assert map_.landmarks.is_vague(np.arange(200, 300)).all()


def test_a_pose_that_is_hardly_known_tells_nothing_of_their_depth():
    rng, none = np.random.default_rng(1), np.zeros(100, dtype=bool)
    points = points_ahead(rng, 100)
    map_ = map_of(rng, points, none)
    before = inverse_depths(map_, 100)[1]
    T = se3.exp(np.array([0.01, 0, 0, 0, 0, 0]))
    assert refine_depths(map_, seen_from(rng, points, T, none), T, 0.1**2 * np.eye(6), UPRIGHT) == 100
    assert (inverse_depths(map_, 100)[1] > 0.9 * before).all()


def test_depth_that_is_measured_later_counts_at_once_and_measured_depth_is_never_moved():
    rng, deep = np.random.default_rng(2), np.arange(100) < 50
    points = points_ahead(rng, 100)
    map_ = map_of(rng, points, deep)
    before = map_.landmarks.position[:50].copy()
    assert map_.landmarks.is_vague(np.arange(100)).tolist() == (~deep).tolist()
    refine_depths(map_, seen_from(rng, points, np.eye(4), np.ones(100, dtype=bool)), np.eye(4), EXACT, UPRIGHT)
    np.testing.assert_array_equal(map_.landmarks.position[:50], before)
    assert np.abs(map_.landmarks.position[50:100, 2] / points[50:, 2] - 1.0).max() < 0.1
    assert not map_.landmarks.assumed[:100].any()


def test_depth_along_a_tilted_axis_is_straightened_before_it_counts():
    rng, tilt, every = np.random.default_rng(4), np.array([0.05, 0.0]), np.ones(200, dtype=bool)
    points = points_ahead(rng, 200)
    map_ = map_of(rng, points, ~every)
    seen = seen_from(rng, points, np.eye(4), every)
    seen.measurements.values[:, 2] /= 1.0 + seen.measurements.values[:, :2] @ tilt
    refine_depths(map_, seen, np.eye(4), EXACT, tilt)
    off, side = map_.landmarks.position[:200, 2] / points[:, 2] - 1.0, points[:, 0] / points[:, 2]
    assert abs(np.median(off[side > 0.2]) - np.median(off[side < -0.2])) < 0.005


def test_many_of_them_do_not_make_a_step_sure_that_a_wrong_assumption_makes():
    """All lie twice as far away as was assumed: the step seems half as long."""
    rng, none = np.random.default_rng(3), np.zeros(300, dtype=bool)
    points = points_ahead(rng, 300)
    points *= 8.0 / points[:, 2:]
    map_ = map_of(rng, points, none)
    T = se3.exp(np.array([0.1, 0, 0, 0, 0, 0]))
    rows, seen = np.arange(300), measured(rng, points, T, none)
    matches = LandmarkMatches(rows, uv_of(points), np.zeros((300, 3)), np.full(300, 0.25), rows)
    found = FoundLandmarks.of(blank_view(1), SENSOR, matches, map_.landmarks)
    fit = fit_pose(found.points, found.covariances, seen.values, seen.covariance, T)
    error = se3.log(fit.T_camera_map @ se3.inverse(T))
    assert abs(error[0]) > 0.04
    assert abs(error[0]) < 2.0 * np.sqrt(np.linalg.inv(fit.information)[0, 0])


def test_many_whose_depth_was_told_by_steps_that_seemed_too_long_do_not_make_the_next_one_sure():
    rng, none = np.random.default_rng(9), np.zeros(300, dtype=bool)
    points = points_ahead(rng, 300)
    map_ = map_of(rng, points, none)
    for k in range(1, 31):
        T, T_seeming = (se3.exp(np.array([-0.01 * k * scale, 0, 0, 0, 0, 0])) for scale in (1.0, 1.05))
        refine_depths(map_, seen_from(rng, points, T, none), T_seeming, EXACT, UPRIGHT)
    rows = np.arange(300)
    assert not map_.landmarks.is_vague(rows).any()
    assert details_of(map_, 0).landmarks.assumed.all()
    T = se3.exp(np.array([-0.4, 0, 0, 0, 0, 0]))
    matches = LandmarkMatches(rows, uv_of(points), np.zeros((300, 3)), np.full(300, 0.25), rows)
    found, seen = FoundLandmarks.of(blank_view(1), SENSOR, matches, map_.landmarks), measured(rng, points, T, none)
    fit = fit_pose(found.points, found.covariances, seen.values, seen.covariance, T)
    error = se3.log(fit.T_camera_map @ se3.inverse(T))
    assert abs(error[0]) > 0.01
    assert abs(error[0]) < 3.0 * np.sqrt(np.linalg.inv(fit.information)[0, 0])


def test_where_enough_have_known_depth_the_others_do_not_decide_on_the_pose():
    rng, deep = np.random.default_rng(4), np.arange(300) < 80
    map_ = map_of(rng, points_ahead(rng, 300), deep)
    for rows, counting in ((np.arange(300), deep), (np.arange(70, 300), np.ones(230, dtype=bool))):
        matches = LandmarkMatches(rows, np.zeros((len(rows), 2)), np.zeros((len(rows), 3)), np.ones(len(rows)), rows)
        np.testing.assert_array_equal(
            FoundLandmarks.of(blank_view(1), SENSOR, matches, map_.landmarks).counts, counting
        )


def test_adjustment_of_nearly_parallel_rays_leaves_them_where_they_can_be():
    """Two key frames 2 cm apart: noise alone would put many a landmark behind the camera, or at infinity."""
    rng, deep = np.random.default_rng(5), np.arange(200) < 60
    points = points_ahead(rng, 200)
    points[60:] *= 20.0 / points[60:, 2:]
    map_, T = map_of(rng, points, deep), se3.exp(np.array([0.02, 0, 0, 0, 0, 0]))
    map_.add_keyframe(blank_view(1), T, seen_from(rng, points, T, deep), ShutterTiming(), 0, 1e-6 * np.eye(6))
    adjustment = map_adjustment.newest(map_, 2, SENSOR, 1.0)
    bundle = adjustment.run()
    map_adjustment.take_over(map_, adjustment, bundle)
    np.testing.assert_allclose(map_.keyframes[1].T_camera_map, T, atol=0.006)
    assert (map_.landmarks.position[:200, 2] > 0.3).all()
    assert (map_.landmarks.position[:200, 2] < 1000.0).all()
    assert np.isnan(map_.keyframes[0].measurements.values[60:, 2]).all()


def test_they_are_neither_shown_nor_saved_before_their_depth_is_known():
    rng, deep = np.random.default_rng(6), np.arange(100) < 50
    map_ = map_of(rng, points_ahead(rng, 100), deep)
    map_.landmarks.seen[:100] = 2
    np.testing.assert_array_equal(cloud_of(map_), map_.landmarks.position[:50])
    np.testing.assert_array_equal(details_of(map_, 0).landmarks.identity, map_.landmarks.identity[:50])


def test_depth_is_assumed_between_the_scene_and_the_horizon_and_only_where_none_was_measured():
    rng, deep = np.random.default_rng(7), np.arange(10) < 5
    before = measured(rng, points_ahead(rng, 10), np.eye(4), deep)
    after = with_assumed_depth(before, np.full((48, 64), 2500, np.uint16))
    np.testing.assert_array_equal(after.values[:5], before.values[:5])
    np.testing.assert_array_equal(after.covariance[:5], before.covariance[:5])
    np.testing.assert_allclose(after.values[5:, 2], 0.2)
    np.testing.assert_allclose(np.sqrt(after.covariance[5:, 3]), 0.2)
    assert np.isnan(before.values[5:, 2]).all()


def test_a_pose_by_few_landmarks_of_known_depth_is_uncertain():
    tracked, covariance = SimpleNamespace(inlier_count=200), 1e-6 * np.eye(6)
    for vague, lacks_depth, reason in (
        (100, False, ""),
        (100, True, ""),
        (150, False, ""),
        (150, True, "hardly any depth: tracked by known landmarks alone"),
        (190, False, "only 10 landmarks of known depth"),
    ):
        state = State.UNCERTAIN if reason else State.TRACKING
        assert judge_pose(tracked, vague, covariance, False, lacks_depth, "") == (state, reason)


@pytest.mark.parametrize("range_m", [1.2, 1.4, 0.1])
def test_a_camera_that_loses_its_depth_goes_on_by_what_it_knows(range_m):
    """From the tenth frame on, little of the room is in range, or nothing: two thirds were LOST."""
    poses, frames = walk_aside()
    ran = run(SMALL, [*frames[:10], *(out_of_range(f, range_m) for f in frames[10:])], AT_ONCE)
    check_sanity(ran)
    assert State.LOST not in ran.states
    for e, T in zip(ran.estimates[1:], poses[1:], strict=True):
        error = se3.log(se3.inverse(e.T_odom_camera) @ se3.inverse(poses[0]) @ T)
        assert np.abs(error).max() < 0.004
        assert error @ np.linalg.solve(e.covariance, error) < 22.5  # chi-squared with 6 degrees of freedom, 99.9 %


@pytest.mark.parametrize("range_m", [1.25, 1.5])
def test_a_walk_with_depth_in_a_tenth_of_the_view_begins_at_once_and_is_accurate(range_m):
    poses, frames = walk_aside()
    ran = run(SMALL, [out_of_range(f, range_m) for f in frames], AT_ONCE)
    check_sanity(ran)
    assert ran.states.count(State.LOST) <= 12
    assert State.LOST not in ran.states[12:]
    first = ran.states.index(State.TRACKING)
    begin = ran.final[first].T_map_camera
    for pose, T in zip(ran.final[first:], poses[first:], strict=True):
        error = se3.log(se3.inverse(se3.inverse(begin) @ pose.T_map_camera) @ se3.inverse(poses[first]) @ T)
        assert np.abs(error).max() < 0.005


@pytest.mark.parametrize("range_m", [0.87, 0.97])
def test_a_kinect_that_sees_depth_of_a_fifth_of_the_desk_goes_on(desk, range_m):
    camera, frames, truth = desk
    odometry = Odometry(camera)
    estimates = [odometry.process(out_of_range(f, range_m)) for f in frames]
    assert np.count_nonzero(odometry.map.landmarks.assumed) > 100
    first = next(k for k, e in enumerate(estimates) if e.state is not State.LOST)
    assert first < 12
    assert all(e.state is not State.LOST for e in estimates[first:])
    judged = verdict(estimates, Ran(tuple(estimates), odometry.finish(), odometry.timing).corrected, truth)
    assert judged.ate_m < 0.006
    assert judged.wrong == 0.0
    assert judged.nees < 9.0
