"""Frames between key frames: kept evenly in bounded number, adjusted at the end; their neighbours move with them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_scene import bare_keyframe
from running import read_tum_frames

from odom.backend import Odometry
from odom.backend.map.frame_log import FrameLog, LoggedFrame
from odom.backend.map.keyframe import Keyframe, MeasuredLandmarks
from odom.backend.map.landmarks import Landmarks
from odom.backend.mapping.intermediate_frames import IntermediateFrames, corrected
from odom.evaluation.mocap_calibration import calibrate
from odom.evaluation.report import evaluate
from odom.evaluation.trajectory import Trajectory
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3
from odom.geometry.arrays import Array


def tracked(reference=0):
    nothing = MeasuredLandmarks.nothing()
    return SimpleNamespace(inlier_landmarks=nothing, displaced=nothing, reference=reference, T_camera_map=np.eye(4))


PERIOD_S = 0.033


def kept_of(count, every, most):
    intermediate = IntermediateFrames(every * PERIOD_S, most)
    for number in range(count):
        if intermediate.wants(number, PERIOD_S):
            intermediate.add(number, tracked(), [bare_keyframe(0, np.eye(4))], Landmarks(), ShutterTiming())
    return intermediate


@given(st.integers(0, 3000), st.integers(1, 7), st.integers(2, 40))
def test_intermediate_frames_are_spread_evenly_over_a_walk_of_any_length(count, every, most):
    numbers = [s.number for s in kept_of(count, every, most).kept]
    assert len(numbers) <= most
    assert len(numbers) >= min(most // 2, -(-count // every))
    assert len(set(np.diff(numbers))) <= 1


@pytest.mark.parametrize(
    ("period_s", "every"), [(0.0333, 6), (1.0 / 60.0, 12), (0.1, 2), (0.133, 2), (0.267, 1), (2.0, 1)]
)
def test_as_many_a_second_are_kept_at_any_rate(period_s, every):
    intermediate = IntermediateFrames(0.2)
    assert [n for n in range(40) if intermediate.wants(n, period_s)] == list(range(0, 40, every))
    assert [n for n in range(40) if intermediate.wants(n, 0.0)] == [0], "of an unknown rate only the first"


@pytest.mark.parametrize("members", [1, 75, 149, 150, 500])
def test_key_frames_and_intermediate_frames_adjusted_together_are_bounded_and_the_newest_is_among_them(members):
    intermediate = kept_of(1200, 6, 240)
    chosen = intermediate.among([bare_keyframe(n, np.eye(4)) for n in range(members)])
    assert len(chosen) <= max(0, 150 - members)
    if members < 150:
        assert chosen[-1] is intermediate.kept[-1]
    assert [s.number for s in chosen] == sorted(s.number for s in chosen)


MOVED = np.array([0.01, -0.02, 0.005, 0.01, 0.02, -0.01])


def a_walk(count: int) -> list[Array]:
    """Poses T_camera_map of frames, one each tenth of a second; key frame n is made at n seconds."""
    start = se3.exp(np.random.default_rng(1).standard_normal(6))
    return [se3.exp(0.02 * number * np.array([1.0, 0.3, 0.0, 0.1, 0.0, 0.2])) @ start for number in range(count)]


def moves(walk: list[Array], of: list[int], keyframes: list[Keyframe], adjusted: dict[int, Array]) -> Array:
    """How far each frame of the walk, placed by its key frame `of` as that was, moves with those adjusted (n x 6)."""
    frames = FrameLog()
    for number, (T, k) in enumerate(zip(walk, of, strict=True)):
        T_keyframe_camera = walk[10 * k] @ se3.inverse(T)
        frames.append(LoggedFrame(Stamp(100_000_000 * number), 0, 0.0, k, T_keyframe_camera))
    found = [
        se3.inverse(frame.T_keyframe_camera) @ keyframes[frame.keyframe].T_camera_map
        for frame in corrected(frames, keyframes, adjusted)
    ]
    return np.array([se3.log(T @ se3.inverse(before)) for T, before in zip(found, walk, strict=True)])


def test_a_frame_between_two_intermediate_ones_moves_as_they_do():
    walk = a_walk(20)
    adjusted = {6: se3.exp(MOVED) @ walk[6], 12: se3.exp(2 * MOVED) @ walk[12]}
    share = np.interp(np.arange(20), [0, 6, 12], [0.0, 1.0, 2.0])
    by = moves(walk, [0] * 20, [bare_keyframe(0, se3.inverse(walk[0]))], adjusted)
    np.testing.assert_allclose(by, share[:, None] * MOVED, atol=1e-12)


def test_frames_move_ever_more_until_the_next_key_frame_which_stands_where_it_was_adjusted():
    walk = a_walk(20)
    next_one = replace(bare_keyframe(1, se3.inverse(se3.exp(MOVED) @ walk[10])), frame=10)
    by = moves(walk, [0] * 11 + [1] * 9, [bare_keyframe(0, se3.inverse(walk[0])), next_one], {})
    np.testing.assert_allclose(by[:11], np.linspace(0.0, 1.0, 11)[:, None] * MOVED, atol=1e-12)


def test_a_frame_at_the_time_of_a_saved_maps_key_frame_is_not_taken_for_it():
    """As where the recording that a map was made of is run again, in that map."""
    walk = a_walk(11)
    places = walk[0], se3.exp(MOVED) @ walk[10]
    saved = [Keyframe.set_aside(k, Stamp(k * 1_000_000_000), 0, T, np.eye(4)) for k, T in enumerate(places)]
    frames = FrameLog()
    for number, T in enumerate(walk):
        frames.append(LoggedFrame(Stamp(100_000_000 * number), 0, 0.0, 0, walk[0] @ se3.inverse(T)))
    found = corrected(frames, saved, {})
    for placed, given_ in zip(found, frames, strict=True):
        np.testing.assert_array_equal(placed.T_keyframe_camera, given_.T_keyframe_camera)


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
    """In the mean over two walks and two starts of each: in a single one, what they give is between 20 and 50 %.

    Judged where the truth's delay and turn against the camera are known, which no adjustment can change.
    """
    shares, among = [], IntermediateFrames.among
    for name in ("tum_fr1_xyz", "tum_fr1_rpy_part"):
        camera, frames, truth = read_tum_frames(shared_data / name, most=192)
        for start in (0, 32):
            odometry = Odometry(camera)
            for frame in frames[start : start + 160]:
                odometry.process(frame)
            errors_m = []
            for among_them in (lambda self, members: [], among):
                monkeypatch.setattr(IntermediateFrames, "among", among_them)
                final = Trajectory.of(odometry.finish())
                errors_m.append(evaluate(final, calibrate(final, truth).camera_truth(truth)).ate_m)
            shares.append(errors_m[1] / errors_m[0])
    print(f"errors by intermediate frames, as shares of those without: {np.round(shares, 3)}")
    assert np.exp(np.mean(np.log(shares))) < 0.8
