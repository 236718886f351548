"""A recording that is played in a loop: its stamps come again, and belong to other frames each time."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import SMALL
from rounds import round_and_more, turned

from odom.backend import Odometry, State
from odom.geometry import se3

FRAMES = 80


@pytest.fixture(scope="module")
def to_and_fro():
    """The odometry after a walk forth and one back with the same stamps, its estimates, and T_room_camera of each."""
    frames = round_and_more(FRAMES)
    back = [replace(frames[FRAMES - 1 - k], stamp=f.stamp, depth_stamp=f.stamp) for k, f in enumerate(frames)]
    odometry = Odometry(SMALL)
    estimates = [odometry.process(frame) for frame in [*frames, *back]]
    there = [turned(k) for k in range(FRAMES)]
    return odometry, estimates, [*there, *reversed(there)]


def test_each_frame_lies_where_it_was_taken(to_and_fro):
    odometry, _, true = to_and_fro
    poses = odometry.finish()
    T_room_map = true[0] @ se3.inverse(poses[0].T_map_camera)
    away = [np.linalg.norm((T_room_map @ p.T_map_camera - T)[:3, 3]) for p, T in zip(poses, true, strict=True)]
    assert max(away) < 0.02


def test_what_moves_is_told_after_the_stamps_went_back_as_before(to_and_fro):
    _, estimates, _ = to_and_fro
    back = [e for e in estimates[FRAMES:] if e.state is State.TRACKING]
    assert len(back) > 0.9 * FRAMES
    assert sum(e.moving is not None for e in back) > 0.9 * len(back)


def test_the_closed_chain_tells_the_rounds_apart(to_and_fro):
    """Both have a node every third of a second at least, and the poses of both lie where the frames were taken."""
    odometry, estimates, true = to_and_fro
    closed = odometry.closed_chain()
    ends_s = [closed.stamps[closed.steps_back == n] * 1e-9 for n in (0, 1)]
    assert max(float(np.diff(each).max()) for each in ends_s) < 0.34
    rounds = [1] * FRAMES + [0] * FRAMES
    poses = [closed.moved(e.stamp, e.chain.T_chain_camera, n) for e, n in zip(estimates, rounds, strict=True)]
    T_room_chain = true[FRAMES] @ se3.inverse(poses[FRAMES])
    away = [np.linalg.norm((T_room_chain @ T - each)[:3, 3]) for T, each in zip(poses, true, strict=True)]
    assert max(away[10:]) < 0.01  # those right behind the first frame, which was bent, are off with it


def test_no_motion_is_published_from_before_a_step_back_of_the_clock_to_after_it():
    frames, set_back = round_and_more(FRAMES), 1_100_000_000
    late = [replace(f, stamp=f.stamp - set_back, depth_stamp=f.stamp - set_back) for f in frames[68:]]
    odometry = Odometry(SMALL)
    estimates = [odometry.process(frame) for frame in [*frames[:68], *late]]
    moved = [m for e in estimates[68:] for m in (e.step, e.second) if m is not None]
    assert len(moved) >= 10
    assert all(m.stamp_earlier >= late[0].stamp for m in moved)
