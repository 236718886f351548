"""Rolling shutter and depth lag: what a moving camera sees of resting points, carried to one time."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sensor_models import sensor_model, view_of

from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.camera.lens import Lens
from odom.frontend.camera.rolling_shutter import ShutterTiming, point_flow
from odom.frontend.features.measurement import measure, points_of
from odom.frontend.features.shutter_compensation import middle_rays, seen_in_motion
from odom.geometry import se3

CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
LENS = Lens.of(CAMERA)
STAMP = Stamp(1_700_000_000_000_000_000)

twists = arrays(np.float64, 6, elements=st.floats(-2.0, 2.0))


@given(st.floats(-0.6, 0.6), st.floats(-0.5, 0.5), st.floats(0.2, 2.0), twists)
def test_point_flow_is_the_derivative_of_a_projected_point(x, y, w, twist):
    point = np.array([x, y, 1.0]) / w

    def seen(t):
        X, Y, Z = se3.apply(se3.exp(-t * twist), point[None])[0]
        return np.array([X / Z, Y / Z, 1.0 / Z])

    step = 1e-5
    numerical = (seen(step) - seen(-step)) / (2.0 * step)
    np.testing.assert_allclose(point_flow(x, y, w, twist), numerical, atol=1e-6)


def plane_seen(normal, distance, T_start_camera, row):
    """A row of the inverse depth image of the plane `normal . X = distance` (start frame) from another pose."""
    n = T_start_camera[:3, :3].T @ normal
    d = distance - normal @ T_start_camera[:3, 3]
    return (LENS.rays[row].astype(np.float64) @ n[:2] + n[2]) / d


NORMAL, DISTANCE_M = np.array([0.3, -0.2, 1.0]), 2.2
"""A slanted wall."""


@cache
def seen_features(twist, readout_s):
    """Rays and inverse depths of features of the wall at the middle row, and their pixels by a rolling shutter."""
    twist, rng = np.array(twist), np.random.default_rng(0)
    rays = rng.uniform((-0.5, -0.38), (0.5, 0.38), (300, 2))
    w = (rays @ NORMAL[:2] + NORMAL[2]) / DISTANCE_M
    points = np.column_stack([rays, np.ones(300)]) / w[:, None]
    uv = LENS.project(points, np.eye(4), -200.0)[:, :2]
    for _ in range(6):  # the row says when, and when says the row
        for k in range(300):
            T = se3.exp(-(uv[k, 1] / 480 - 0.5) * readout_s * twist)
            uv[k] = LENS.project(points[k : k + 1], T, -200.0)[0, :2]
    return rays, w, uv


def moving_view(twist, readout_s, depth_time_s, depth_readout_s):
    """Features of the wall as rolling shutters show them, the depth image, and the truth at the middle row."""
    rays, w, uv = seen_features(tuple(twist), readout_s)
    rows = [depth_time_s + (v / 480 - 0.5) * depth_readout_s for v in range(480)]
    inverse_depth = np.stack([plane_seen(NORMAL, DISTANCE_M, se3.exp(t * twist), v) for v, t in enumerate(rows)])
    inside = ((uv > 25) & (uv < (615, 455))).all(axis=1)
    return uv[inside], np.rint(1000.0 / inverse_depth).astype(np.uint16), np.column_stack([rays, w])[inside]


@pytest.mark.parametrize(
    "twist", [(0.5, 0.1, 0.4, 0, 0, 0), (0, 0, 0, 0.8, 1.0, 0.6), (-0.4, 0.3, 0.5, -0.7, 0.9, -0.8)]
)
@pytest.mark.parametrize("readout_s", [0.0, 0.025, -0.025])
@pytest.mark.parametrize("depth_readout_s", [0.0, 0.02, -0.02])
@pytest.mark.parametrize("depth_delay_ns", [-18_000_000, 12_000_000])
def test_rows_and_depth_are_carried_to_the_middle_row(twist, readout_s, depth_readout_s, depth_delay_ns):
    twist, lag_s = np.array(twist, dtype=np.float64), -0.006
    since_middle_row_s = depth_delay_ns * 1e-9 + lag_s + abs(readout_s) / 2
    uv, depth_mm, truth = moving_view(twist, readout_s, since_middle_row_s, depth_readout_s)
    frame = RgbdFrame(0, STAMP, np.zeros((480, 640), np.uint8), Stamp(STAMP + depth_delay_ns), depth_mm)
    nothing = np.zeros((len(uv), 3))
    carried = measure(
        view_of(frame), sensor_model(CAMERA, ShutterTiming(readout_s, lag_s, depth_readout_s)), uv, nothing, twist
    )
    as_seen = measure(view_of(frame), sensor_model(CAMERA), uv, nothing, np.zeros(6))
    deep = np.isfinite(carried.values[:, 2]) & np.isfinite(as_seen.values[:, 2])
    assert deep.mean() > 0.95
    errors = [np.abs(m.values[deep] - truth[deep]) for m in (carried, as_seen)]
    assert np.percentile(errors[0][:, :2], 95) < max(0.05 * np.percentile(errors[1][:, :2], 95), 0.05 / 525)
    assert np.sqrt(np.mean(errors[0][:, 2] ** 2)) < 6e-4


@pytest.mark.parametrize(
    "twist", [(0.5, 0.1, 0.4, 0, 0, 0), (0, 0, 0, 0.8, 1.0, 0.6), (-0.4, 0.3, 0.5, -0.7, 0.9, -0.8)]
)
@pytest.mark.parametrize("readout_s", [0.025, -0.025])
def test_points_are_expected_where_the_shutter_shows_them(twist, readout_s):
    uv, _, truth = moving_view(np.array(twist), readout_s, 0.0, 0.0)
    points = np.column_stack([truth[:, :2], np.ones(len(truth))]) / truth[:, 2:]
    expected = seen_in_motion(points, np.eye(4), LENS, np.array(twist), readout_s, 10.0)
    np.testing.assert_allclose(expected[:, :2], uv, atol=0.1)
    np.testing.assert_allclose(expected[:, 2], points[:, 2])
    assert np.abs(LENS.project(points, np.eye(4), 10.0)[:, :2] - uv).max() > 1.0


@given(twists, st.floats(1.0, 3.0), st.floats(-0.033, 0.033))
def test_a_ray_is_carried_back_from_where_it_is_expected(twist, faster, readout_s):
    rng = np.random.default_rng(3)
    rays, w = rng.uniform((-0.6, -0.45), (0.6, 0.45), (100, 2)), rng.uniform(0.2, 1.5, 100)
    twist = twist * np.repeat([1.0, faster], 3)
    points = np.column_stack([rays, np.ones(100)]) / w[:, None]
    expected = seen_in_motion(points, np.eye(4), LENS, twist, readout_s, 1.0)
    seen = expected[:, 2] > 0.0
    back = middle_rays(LENS.rays, expected[seen, :2], w[seen], twist, readout_s)
    np.testing.assert_allclose(back, rays[seen], atol=0.05 / 525.0)


def test_of_a_global_shutter_or_at_rest_nothing_is_shifted():
    points = np.random.default_rng(4).uniform((-1.0, -0.8, 1.0), (1.0, 0.8, 3.0), (100, 3))
    straight = LENS.project(points, np.eye(4), 10.0)
    np.testing.assert_array_equal(seen_in_motion(points, np.eye(4), LENS, np.ones(6), 0.0, 10.0), straight)
    np.testing.assert_array_equal(seen_in_motion(points, np.eye(4), LENS, np.zeros(6), 0.03, 10.0), straight)


@pytest.mark.parametrize("readouts_s", [(0.016, 0.021), (0.003, -0.004), (-0.021, -0.016)])
def test_retimed_values_are_those_of_a_new_measurement(readouts_s):
    twist = np.array([0.3, -0.2, 0.4, 0.6, -0.8, 0.5])
    uv, depth_mm, _ = moving_view(twist, 0.02, -0.008, 0.012)
    frame = RgbdFrame(0, STAMP, np.zeros((480, 640), np.uint8), STAMP, depth_mm)
    nothing = np.zeros((len(uv), 3))
    before, after = ShutterTiming(readouts_s[0], -0.010, 0.005), ShutterTiming(readouts_s[1], -0.004, 0.018)
    a, b = (measure(view_of(frame), sensor_model(CAMERA, timing), uv, nothing, twist) for timing in (before, after))
    change = before.change_to(after)
    deep = np.isfinite(a.values[:, 2]) & np.isfinite(b.values[:, 2])
    moved = np.abs(b.values - a.values)[deep]
    left = np.abs(b.values - a.retimed(change).values)[deep]
    assert np.mean(moved[:, :2]) > 20 * np.mean(left[:, :2])
    assert np.mean(left[:, 2]) < 5e-4


def test_no_depth_is_nan_and_leaves_the_ray():
    uv = np.array([[100.5, 200.25], [500.0, 300.0]])
    frame = RgbdFrame(0, STAMP, np.zeros((480, 640), np.uint8), STAMP, np.zeros((480, 640), np.uint16))
    m = measure(view_of(frame), sensor_model(CAMERA, ShutterTiming(0.02, 0.01)), uv, np.zeros((2, 3)), np.full(6, 0.5))
    assert np.isnan(m.values[:, 2]).all()
    assert np.isfinite(m.values[:, :2]).all()
    assert np.isfinite(m.covariance[:, :3]).all()


def test_the_covariance_of_points_is_that_of_sampled_measurements():
    rng = np.random.default_rng(5)
    _, depth_mm, truth = moving_view(np.zeros(6), 0.0, 0.0, 0.0)
    frame = RgbdFrame(0, STAMP, np.zeros((480, 640), np.uint8), STAMP, depth_mm)
    m = measure(
        view_of(frame), sensor_model(CAMERA), np.array([[150.0, 350.0]]), np.array([[0.3, 0.1, 0.5]]), np.zeros(6)
    )
    xx, xy, yy, ww = m.covariance[0]
    samples = m.values[0] + np.column_stack(
        [rng.multivariate_normal([0, 0], [[xx, xy], [xy, yy]], 20000), rng.normal(0, np.sqrt(ww), 20000)]
    )
    points, _ = points_of(replace(m, values=samples, covariance=np.tile(m.covariance, (20000, 1))))
    claimed = points_of(m)[1][0]
    np.testing.assert_allclose(np.cov(points.T), claimed, atol=0.05 * claimed.max())
    assert len(truth)


@pytest.mark.parametrize("readouts_s", [(0.016, 0.021), (0.016, -0.021), (-0.016, 0.021)])
def test_a_timing_is_changed_by_what_leads_there(readouts_s):
    before, after = ShutterTiming(readouts_s[0], -0.010, 0.005), ShutterTiming(readouts_s[1], -0.004, 0.018)
    np.testing.assert_allclose(before.changed(before.change_to(after)).vector, after.vector, atol=1e-15)


@pytest.mark.parametrize("readouts_s", [(0.016, 0.021), (0.016, -0.021)])
def test_derivatives_by_one_timing_are_those_by_changes_of_another(readouts_s):
    before, after = ShutterTiming(readouts_s[0], -0.010, 0.005), ShutterTiming(readouts_s[1], -0.004, 0.018)
    small = np.array([1e-4, -2e-4, 3e-4])
    further = before.change_to(after.changed(small)) - before.change_to(after)
    np.testing.assert_allclose(before.by_change_of(after) @ small, further, atol=1e-12)
