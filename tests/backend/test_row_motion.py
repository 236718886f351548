"""Rows are carried to the middle one's time by the velocity that the trajectory shows, not by the last step."""

from dataclasses import replace

import numpy as np
import pytest

from odom.backend.map.frame_log import FrameLog, LoggedFrame
from odom.backend.map.keyframe import Keyframe
from odom.backend.mapping.row_motion import carried_anew, flow, rays_as_seen, twists_at
from odom.calibration.parameters import LENS, vector_of
from odom.calibration.projection import project
from odom.frame import Camera, Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming, point_flow
from odom.frontend.features.measurement import Measurements
from odom.geometry import se3

CAMERA = Camera(640, 480, 525.0, 520.0, 319.5, 239.5, (0.1, -0.2, 0.001, 0.0, 0.0))
READOUT_S, PERIOD_S = 0.027, 1.0 / 30.0
TIMING = ShutterTiming(READOUT_S)
TWIST = np.array([0.3, -0.1, 0.4, 0.2, -0.5, 0.3])


def swinging(seconds):
    """T_map_camera of a camera that goes on and swings to and fro, one and a half times a second."""
    return se3.exp(TWIST * seconds) @ se3.exp(0.05 * np.sin(9.0 * seconds) * np.ones(6))


def keyframe(number, segment):
    return Keyframe.set_aside(number, Stamp(number), segment, np.eye(4), np.eye(4))


def logged(keyframes, hidden=(), frames=30):
    """The frames of a swinging camera, their middle rows some 13 ms before their stamps, told by key frame 0 or 1."""
    log = FrameLog()
    for k in range(frames):
        stamp, delay_s = Stamp(round(k * PERIOD_S * 1e9)), READOUT_S / 2
        if k in hidden:
            log.append(LoggedFrame(stamp, 0))
        else:
            number = int(k >= frames // 2)
            log.append(LoggedFrame(stamp, 0, 0.0, number, swinging(stamp * 1e-9 - delay_s)))
    return log


def velocity(seconds):
    step = 1e-4
    return se3.log(se3.inverse(swinging(seconds - step)) @ swinging(seconds + step)) / (2 * step)


def test_the_velocity_is_that_of_the_moment_and_not_of_the_frame_before():
    keyframes = [keyframe(0, 0), keyframe(1, 0)]
    log = logged(keyframes)
    found = twists_at(range(3, len(log) - 3), log, keyframes, TIMING)
    true = np.array([velocity(frame.stamp * 1e-9 - frame.delay_s(TIMING)) for frame in list(log)[3:-3]])
    middles = [swinging(frame.stamp * 1e-9 - frame.delay_s(TIMING)) for frame in log]
    before = np.array([se3.log(se3.inverse(middles[k - 1]) @ middles[k]) / PERIOD_S for k in range(3, len(log) - 3)])
    late, off = (np.sqrt(((one - true) ** 2).mean()) for one in (before, found))
    assert off < 0.5 * late


def test_where_nothing_is_known_on_one_side_there_is_none():
    keyframes = [keyframe(0, 0), keyframe(1, 1)]
    log = logged(keyframes, hidden=(5, 6, 7))
    found = np.isfinite(twists_at(range(len(log)), log, keyframes, TIMING)).all(axis=1)
    ends = {0, 4, 5, 6, 7, 8, 14, 15, 29}  # of the walk, of what was lost, and of the segments
    assert set(np.flatnonzero(~found)) == ends
    assert not np.isfinite(twists_at([-1, 30], log, keyframes, TIMING)).any()
    assert not np.isfinite(twists_at([0], FrameLog(), keyframes, TIMING)).any()


def test_frames_of_another_time_with_the_same_stamps_count_for_nothing():
    keyframes = [keyframe(0, 0), keyframe(1, 0)]
    once = logged(keyframes)
    twice = logged(keyframes)
    for frame in logged([keyframe(0, 0), keyframe(0, 0)]):
        twice.append(replace(frame, T_keyframe_camera=np.eye(4)))
    found = twists_at(range(30), twice, keyframes, TIMING)
    np.testing.assert_array_equal(found, twists_at(range(30), once, keyframes, TIMING))


def test_flow_is_that_of_the_frontend():
    rng = np.random.default_rng(0)
    rays, w, twist = rng.normal(size=(20, 2)), rng.uniform(0.3, 2.0, 20), rng.normal(size=(20, 6))
    each = [point_flow(x, y, z, one) for (x, y), z, one in zip(rays, w, twist, strict=True)]
    assert flow(rays, w, twist) == pytest.approx(np.array(each), abs=1e-12)


def test_rays_carried_by_a_wrong_velocity_are_carried_by_the_right_one():
    rng = np.random.default_rng(1)
    points = rng.uniform((-1.0, -0.8, 1.5), (1.0, 0.8, 3.0), (50, 3))
    wrong = TWIST + 0.1 * rng.normal(size=6)
    true = points[:, :2] / points[:, 2:]
    raw, row = true.copy(), np.zeros(50)
    for _ in range(10):  # where a row sees a point depends on the row
        row = project(raw, vector_of(CAMERA)[LENS])[0][:, 1] / CAMERA.height - 0.5
        raw = np.array(
            [
                (p[:2] / p[2])
                for p in (
                    (se3.inverse(se3.exp(TWIST * at * READOUT_S)) @ np.append(point, 1.0))[:3]
                    for point, at in zip(points, row, strict=True)
                )
            ]
        )
    by_readout = -flow(raw, 1.0 / points[:, 2], np.tile(wrong, (50, 1)))[:, :2] * row[:, None]
    jacobian = np.zeros((50, 3, 3))
    jacobian[:, :2, 0] = by_readout
    values = np.column_stack([raw + by_readout * READOUT_S, 1.0 / points[:, 2]])
    seen = Measurements(values, jacobian, np.ones((50, 4)), np.zeros((50, 2)))
    at = project(rays_as_seen(seen, READOUT_S), vector_of(CAMERA)[LENS])[0][:, 1] / CAMERA.height - 0.5
    np.testing.assert_allclose(at, row, atol=1e-9)
    again = carried_anew(seen, at, 1.0 / points[:, 2], np.tile(TWIST, (50, 1)), READOUT_S)
    before, after = (np.abs(one.values[:, :2] - true).max() for one in (seen, again))
    assert after < 0.05 * before
    assert again.values[:, 2] == pytest.approx(values[:, 2])
    unknown = carried_anew(seen, at, 1.0 / points[:, 2], np.full((50, 6), np.nan), READOUT_S)
    assert np.array_equal(unknown.values, seen.values)
    assert np.array_equal(unknown.jacobian_timing, seen.jacobian_timing)
