"""The frames' places: given back exactly, at a known price, and no more of them than the bound."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from made_up_scene import bare_keyframe

from odom.backend.map.frame_log import FrameLog, LoggedFrame
from odom.backend.odometry.final_trajectory import at_stamps
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3

BYTES_A_FRAME = 150


def placed(k, lost=False):
    stamp, rng = Stamp(1_700_000_000_000_000_000 + 33_333_333 * k), np.random.default_rng(k)
    if lost:
        return LoggedFrame(stamp, k % 5 - 1)
    late_s = float(rng.normal()) if k % 3 else None
    return LoggedFrame(stamp, k % 5, late_s, int(rng.integers(1 << 20)), se3.exp(rng.normal(size=6)))


def assert_same(a, b):
    assert (a.stamp, a.segment, a.late_s, a.keyframe) == (b.stamp, b.segment, b.late_s, b.keyframe)
    assert type(a.stamp) is type(b.stamp) is int
    assert (a.T_keyframe_camera is None) == (b.T_keyframe_camera is None)
    if a.T_keyframe_camera is not None:
        assert a.T_keyframe_camera.tobytes() == b.T_keyframe_camera.tobytes()


def test_frames_come_back_exactly_as_they_were_given():
    given = [placed(k, lost=k % 7 == 3) for k in range(50)]
    frames = FrameLog(block=8, most=64)
    assert frames.last is None
    for k, frame in enumerate(given):
        frames.append(frame)
        assert_same(frames.last, frame)
        assert frames.count == len(frames) == k + 1
    for kept, frame in zip(frames, given, strict=True):
        assert_same(kept, frame)
    assert frames.dropped == 0


def test_a_frame_that_is_moved_keeps_all_but_its_pose_and_no_other_moves():
    given = [placed(k) for k in range(50)]
    frames = FrameLog(block=8, most=32)
    for frame in given:
        frames.append(frame)
    T = se3.exp(np.arange(6.0) / 10)
    frames.move(30, T)
    for number in range(frames.dropped, 50):
        assert_same(frames[number], replace(given[number], T_keyframe_camera=T) if number == 30 else given[number])
    for gone in (frames.dropped - 1, 50):
        with pytest.raises(IndexError, match=f"frame {gone} is not among"):
            frames[gone]


def test_of_a_covariance_the_mean_variance_of_the_position_is_kept():
    frames = FrameLog()
    covariance = np.diag([1e-6, 2e-6, 3e-6, 1.0, 1.0, 1.0])
    frames.append(LoggedFrame(Stamp(1), 0, 0.0, 0, np.eye(4), covariance))
    frames.append(placed(2))
    known, unknown = frames
    np.testing.assert_allclose(known.position_variance, 2e-6)
    assert known.covariance is None
    assert np.isnan(unknown.position_variance)


def test_the_oldest_block_is_dropped_at_the_bound_and_counted():
    given = [placed(k) for k in range(100)]
    frames = FrameLog(block=8, most=32)
    for frame in given:
        frames.append(frame)
        assert len(frames) <= 32
        assert frames.dropped % 8 == 0
        assert frames.dropped + len(frames) == frames.count
    assert frames.count == 100
    for kept, frame in zip(frames, given[frames.dropped :], strict=True):
        assert_same(kept, frame)


def test_a_frame_costs_less_than_150_bytes():
    frames, given, many = FrameLog(), [placed(k) for k in range(64)], 5 * 4096
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for k in range(many):
        frames.append(given[k % 64])
    cost = (tracemalloc.get_traced_memory()[0] - before) / many
    tracemalloc.stop()
    assert cost < BYTES_A_FRAME


def test_the_twist_is_kept_to_single_precision():
    frames, twist = FrameLog(), np.random.default_rng(1).normal(size=6)
    frames.append(LoggedFrame(Stamp(1), 0, 0.0, 0, np.eye(4), twist=twist))
    frames.append(placed(2))
    known, unknown = frames
    np.testing.assert_allclose(known.twist, twist, rtol=1e-6)
    assert unknown.twist is None


def test_the_trajectory_goes_on_from_what_is_left():
    keyframes, timing = [bare_keyframe(0, np.eye(4))], ShutterTiming(readout_s=0.02)
    given = [LoggedFrame(Stamp(k * 33_333_333), 0, 0.004, 0, se3.exp(np.full(6, 0.01 * k))) for k in range(40)]
    frames = FrameLog(block=8, most=16)
    for frame in given:
        frames.append(frame)
    whole, left = at_stamps(given, keyframes, timing), at_stamps(frames, keyframes, timing)
    assert [p.stamp for p in left] == [p.stamp for p in whole[frames.dropped :]]
    for a, b in zip(left, whole[frames.dropped :], strict=True):
        assert a.T_map_camera.tobytes() == b.T_map_camera.tobytes()
