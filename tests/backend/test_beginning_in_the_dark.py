"""Noise is no scene: it has no corners, and no segment begins in a room without light."""

import numpy as np
import pytest

from odom import Camera, RgbdFrame
from odom.backend import Odometry, State
from odom.evaluation.robustness import color
from odom.frontend.features.corners import detect_corners

BEGIN, PERIOD = 1_700_000_000_000_000_000, 33_333_333


@pytest.mark.parametrize("sigma", [1.0, 2.0, 4.0, 8.0])
def test_there_are_no_corners_in_noise(sigma):
    noise = np.random.default_rng(1).normal(120.0, sigma, (480, 640))
    assert len(detect_corners(np.rint(noise).astype(np.uint8), np.zeros((0, 2)), 20)) <= 3


@pytest.mark.long
def test_no_segment_begins_in_the_dark():
    wall = np.random.default_rng(0).integers(0, 256, (60, 120), dtype=np.uint8).repeat(8, axis=0).repeat(8, axis=1)
    noise = np.random.default_rng(1)  # without it the same depth again would be that of a driver that hangs
    odometry, states = Odometry(Camera(640, 480, 525.0, 525.0, 319.5, 239.5)), []
    for k in range(60):
        depth_mm = np.rint(noise.normal(2100.0, 5.0, (480, 640))).astype(np.uint16)
        lit = RgbdFrame(k, BEGIN + k * PERIOD, wall[:480, k : k + 640].copy(), BEGIN + k * PERIOD, depth_mm)
        states.append(odometry.process(lit if k < 10 or k > 56 else color.darkness(lit, 0.0, 1)).state)
    assert set(states[:10]) == {State.TRACKING}
    assert set(states[16:57]) == {State.LOST}
    assert states[57] is State.RECOVERED
