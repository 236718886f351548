"""How far depth's unit is off, by motion capture: surely where the camera moves far, unsurely where errors are slow."""

import numpy as np
import pytest

from odom.calibration.metric_scale import metric_scale
from odom.evaluation.run_report import CAMERA
from odom.evaluation.trajectory import Trajectory

SECONDS = np.arange(0.0, 16.0, 1.0 / 30.0)


def trajectory(positions):
    T = np.tile(np.eye(4), (len(positions), 1, 1))
    T[:, :3, 3] = positions
    return Trajectory((SECONDS * 1e9).astype(np.int64), T)


def walk(size):
    return size * np.column_stack([np.sin(1.3 * SECONDS), np.sin(1.9 * SECONDS + 1.0), np.cos(0.7 * SECONDS)])


@pytest.mark.parametrize("seed", range(3))
def test_a_way_of_metres_shows_the_unit_surely(seed):
    measured = 0.97 * walk(0.4) + np.random.default_rng(seed).normal(0.0, 0.002, (len(SECONDS), 3))
    found = metric_scale(trajectory(measured), {CAMERA: trajectory(walk(0.4))})
    assert found.ratio == pytest.approx(0.97, abs=3.0 * found.sigma)
    assert found.sigma < 0.006


@pytest.mark.parametrize("period_s", [5.0, 7.0, 11.0])
def test_slow_errors_as_large_as_the_way_are_in_the_sigma(period_s):
    slow = 0.015 * np.column_stack([np.sin(2.0 * np.pi / period_s * SECONDS + k) for k in range(3)])
    found = metric_scale(trajectory(0.97 * walk(0.05) + slow), {CAMERA: trajectory(walk(0.05))})
    assert found.ratio == pytest.approx(0.97, abs=2.5 * found.sigma)
    assert found.sigma > 0.02
