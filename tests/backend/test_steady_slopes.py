"""A landmark's surface has one slope in all frames: a lag fitted by slopes of single frames comes out too small."""

import numpy as np
import pytest

from odom.backend.mapping.steady_slopes import steadied
from odom.frontend.camera.rolling_shutter import point_flow
from odom.frontend.features.measurement import Measurements
from odom.geometry import se3

FOCAL_PX = np.array([520.0, 515.0])
FRAMES, LANDMARKS = 12, 150
HALF = np.full(FRAMES * LANDMARKS, 0.5)
SLOPE_NOISE = 1e-3
"""1/m for each pixel; a surface at 1 m, seen at 45 degrees, has 2e-3."""


def walk(seed):
    """Landmarks on slanting surfaces in frames of a shaking camera: measurements by true slopes, poses, landmarks."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((-1.0, -0.8, 1.2), (1.0, 0.8, 2.5), (LANDMARKS, 3))
    normals = np.column_stack([rng.uniform(-0.6, 0.6, (LANDMARKS, 2)), -np.ones(LANDMARKS)])
    values, rises, jacobians, R = [], [], [], []
    for _ in range(FRAMES):
        T, twist = se3.exp(rng.normal(0.0, 0.1, 6)), rng.normal(0.0, (0.2, 0.2, 0.2, 1.0, 1.0, 1.0))
        x, n = points @ T[:3, :3].T + T[:3, 3], normals @ T[:3, :3].T
        for (u, v, z), normal in zip(x, n, strict=True):
            ray, row = np.array([u / z, v / z, 1.0]), v / z
            rise = normal[:2] / z / (normal @ ray)
            xd, yd, wd = point_flow(ray[0], ray[1], 1.0 / z, twist)
            by_lag = rise @ (xd, yd) - wd
            by_readout = (0.5 - row) * by_lag - wd * row
            jacobians.append([[-xd * row, 0, 0], [-yd * row, 0, 0], [by_readout, by_lag, row * by_lag]])
            values.append([*ray[:2], 1.0 / z])
            rises.append(rise)
            R.append(T[:3, :3])
    seen = Measurements(np.array(values), np.array(jacobians), np.ones((len(values), 4)), np.array(rises) / FOCAL_PX)
    return seen, np.array(R), np.tile(np.arange(LANDMARKS), FRAMES)


def with_noisy_slopes(seen, seed):
    """The same as single frames read it: a slope is noisy, and so are the derivatives by it."""
    noise = np.random.default_rng(seed).normal(0.0, SLOPE_NOISE, seen.slope.shape)
    J, row = seen.jacobian_timing.copy(), seen.values[:, 1]
    by_lag = (noise * FOCAL_PX * (-J[:, :2, 0] / row[:, None])).sum(axis=1)
    J[:, 2] += by_lag[:, None] * np.column_stack([0.5 - row, np.ones(len(row)), row])
    return Measurements(seen.values, J, seen.covariance, seen.slope + noise)


def fitted(by, true, lag_s):
    """The lag that explains true depths best, by the derivatives of measurements `by`."""
    J = by.jacobian_timing[:, 2, 1]
    return J @ (true.jacobian_timing[:, 2, 1] * lag_s) / (J @ J)


@pytest.mark.parametrize("seed", range(4))
def test_a_lag_is_found_whole_though_slopes_are_noisy(seed):
    true, R, landmark = walk(seed)
    noisy = with_noisy_slopes(true, seed + 10)
    assert fitted(noisy, true, 0.015) < 0.75 * 0.015
    assert fitted(steadied(noisy, R, landmark, HALF, FOCAL_PX), true, 0.015) == pytest.approx(0.015, rel=0.1)


def test_true_slopes_stay():
    true, R, landmark = walk(0)
    steady = steadied(true, R, landmark, HALF, FOCAL_PX)
    np.testing.assert_allclose(steady.jacobian_timing, true.jacobian_timing, atol=1e-9)
    assert steady.values is true.values


def test_where_no_depth_was_measured_nothing_changes_and_others_have_their_slope():
    true, R, landmark = walk(1)
    noisy = with_noisy_slopes(true, 2)
    noisy.values[::5, 2] = np.nan
    noisy.slope[::5] = 0.0
    noisy.jacobian_timing[::5, 2] = 0.0
    steady = steadied(noisy, R, landmark, HALF, FOCAL_PX)
    assert np.isfinite(steady.jacobian_timing).all()
    np.testing.assert_array_equal(steady.jacobian_timing[::5], noisy.jacobian_timing[::5])
    assert (steady.jacobian_timing[1::5, 2, 1] != noisy.jacobian_timing[1::5, 2, 1]).mean() > 0.95
