"""Frames between key frames: kept evenly in bounded number, adjusted at the end; their neighbours move with them."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_scene import bare_keyframe
from running import read_tum_frames

from odom.backend import Odometry
from odom.backend.map.frame_log import FrameLog, LoggedFrame
from odom.backend.map.keyframe import Measured
from odom.backend.map.landmarks import Landmarks
from odom.backend.mapping.intermediate_frames import IntermediateFrames, corrected
from odom.evaluation.mocap_calibration import calibrate
from odom.evaluation.report import evaluate
from odom.evaluation.trajectory import Trajectory
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3


def tracked(reference=0):
    nothing = Measured.nothing()
    return SimpleNamespace(inlying=nothing, displaced=nothing, reference=reference, T_camera_map=np.eye(4))


def kept_of(count, every, most):
    intermediate = IntermediateFrames(every, most)
    for number in range(count):
        if intermediate.wants(number):
            intermediate.add(number, tracked(), [bare_keyframe(0, np.eye(4))], Landmarks(), ShutterTiming())
    return intermediate


@given(st.integers(0, 3000), st.integers(1, 7), st.integers(2, 40))
def test_intermediate_frames_are_spread_evenly_over_a_walk_of_any_length(count, every, most):
    numbers = [s.number for s in kept_of(count, every, most).kept]
    assert len(numbers) <= most
    assert len(numbers) >= min(most // 2, -(-count // every))
    assert len(set(np.diff(numbers))) <= 1


@pytest.mark.parametrize("members", [1, 75, 149, 150, 500])
def test_key_frames_and_intermediate_frames_adjusted_together_are_bounded_and_the_newest_is_among_them(members):
    intermediate = kept_of(1200, 6, 240)
    chosen = intermediate.among([bare_keyframe(n, np.eye(4)) for n in range(members)])
    assert len(chosen) <= max(0, 150 - members)
    if members < 150:
        assert chosen[-1] is intermediate.kept[-1]
    assert [s.number for s in chosen] == sorted(s.number for s in chosen)


def test_a_frame_between_two_intermediate_ones_moves_as_they_do():
    rng = np.random.default_rng(1)
    keyframe = bare_keyframe(0, se3.exp(rng.standard_normal(6)))
    frames, T_camera_map = FrameLog(), []
    for number in range(20):
        T = se3.exp(0.02 * number * np.array([1.0, 0.3, 0.0, 0.1, 0.0, 0.2])) @ keyframe.T_camera_map
        T_camera_map.append(T)
        frames.append(LoggedFrame(Stamp(number), 0, 0.0, 0, keyframe.T_camera_map @ se3.inverse(T)))
    moved = np.array([0.01, -0.02, 0.005, 0.01, 0.02, -0.01])
    adjusted = {5: se3.exp(moved) @ T_camera_map[5], 11: se3.exp(2 * moved) @ T_camera_map[11]}
    found = [se3.inverse(p.T_keyframe_camera) @ keyframe.T_camera_map for p in corrected(frames, [keyframe], adjusted)]
    by = np.array([se3.log(T @ se3.inverse(before)) for T, before in zip(found, T_camera_map, strict=True)])
    share = np.interp(np.arange(20), [-1, 5, 11], [0.0, 1.0, 2.0])
    np.testing.assert_allclose(by, share[:, None] * moved, atol=1e-12)


def test_frames_of_a_key_frame_without_intermediate_frames_and_lost_ones_stay():
    keyframes = [bare_keyframe(0, np.eye(4)), bare_keyframe(1, np.eye(4))]
    frames = FrameLog()
    frames.append(LoggedFrame(Stamp(0), 0, 0.0, 0, np.eye(4)))
    frames.append(LoggedFrame(Stamp(1), 0, 0.0))
    frames.append(LoggedFrame(Stamp(2), 0, 0.0, 1, np.eye(4)))
    placed = list(corrected(frames, keyframes, {0: se3.exp(np.full(6, 0.1))}))
    assert placed[1].keyframe is None
    np.testing.assert_array_equal(placed[2].T_keyframe_camera, np.eye(4))


@pytest.mark.long
def test_intermediate_frames_make_the_final_trajectory_more_accurate(shared_data, monkeypatch):
    """In the mean over two walks and six starts of each: in a single one, what they give is between 0 and 30 %.

    Judged where the truth's delay and turn against the camera are known, which no adjustment can change.
    """
    shares, among = [], IntermediateFrames.among
    for name in ("tum_fr1_xyz", "tum_fr1_rpy_part"):
        camera, frames, truth = read_tum_frames(shared_data / name, most=280)
        for start in range(0, 48, 8):
            odometry = Odometry(camera)
            for frame in frames[start : start + 240]:
                odometry.process(frame)
            errors_m = []
            for among_them in (lambda self, members: [], among):
                monkeypatch.setattr(IntermediateFrames, "among", among_them)
                final = Trajectory.of(odometry.finish())
                errors_m.append(evaluate(final, calibrate(final, truth).camera_truth(truth)).ate_m)
            shares.append(errors_m[1] / errors_m[0])
    assert np.exp(np.mean(np.log(shares))) < 0.9
