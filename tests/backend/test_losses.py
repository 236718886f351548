"""What a camera that was lost is taken for: the place it is known to have come to, at once, and no other."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from painted_room import PERIOD, SMALL, START, PaintedRoom, stroll
from running import check_sanity, run

from odom.backend import Odometry, OdometrySettings, State
from odom.backend.odometry.lost_camera import searched_s
from odom.frame import Stamp
from odom.geometry import se3

ROOM, OTHER_ROOM = PaintedRoom(0), PaintedRoom(7)


def shown(poses, room=ROOM):
    """Frames of a camera at `poses` (T_room_camera), every period."""
    return [room.frame(SMALL, k, T) for k, T in enumerate(poses)]


def in_order(frames):
    """The frames with numbers and stamps of a stream without a hole."""
    stamps = [Stamp(START + k * PERIOD) for k in range(len(frames))]
    return [replace(f, sequence=k, stamp=s, depth_stamp=s) for k, (f, s) in enumerate(zip(frames, stamps, strict=True))]


def blank(frames):
    return [replace(f, color=np.zeros_like(f.color)) for f in frames]


def turned(T, angle):
    out = T.copy()
    out[:3, :3] = out[:3, :3] @ se3.so3_exp(np.array([0.0, angle, 0.0]))
    return out


def test_a_first_frame_that_nothing_follows_is_given_up_at_once():
    frames = shown([turned(stroll(k / 30.0), 0.0 if k else 0.8) for k in range(20)])
    ran = run(SMALL, [frames[0], *frames[4:]])
    check_sanity(ran)
    assert ran.states[:2] == [State.TRACKING, State.RECOVERED]
    assert set(ran.states[2:]) == {State.TRACKING}


def test_what_was_seen_just_before_a_loss_is_known_again_after_it():
    walk = shown([stroll(k / 30.0) for k in range(10)])
    glimpse = shown([np.eye(4)] * 50, OTHER_ROOM)
    begun = next(e.sequence for e in run(SMALL, in_order([*walk, *glimpse])).estimates if e.segment == 1)
    seen_once = [*walk, *glimpse[: begun + 1 - len(walk)]]
    ran = run(SMALL, in_order([*seen_once, *blank(glimpse[:10]), *glimpse[:10]]))
    check_sanity(ran)
    back = ran.estimates[len(seen_once) + 10]
    assert (back.segment, back.state) == (1, State.RECOVERED)


def test_a_place_that_cannot_be_reached_so_soon_is_not_believed():
    walk = [turned(stroll(k / 30.0), -0.02 * k) for k in range(60)]
    frames = shown([*walk, *walk[5:20]])
    assert run(SMALL, frames[:60]).states[-1] is State.TRACKING
    ran = run(SMALL, frames)
    check_sanity(ran)
    jump_rad = np.linalg.norm(se3.log(se3.inverse(walk[59]) @ walk[5])[3:])
    assert 0.6 < jump_rad < 1.5
    assert not {State.TRACKING, State.RECOVERED} & set(ran.states[60 : 60 + int(30 * jump_rad / 12.0)])
    assert ran.states[-5:] == [State.TRACKING] * 5
    assert {e.segment for e in ran.estimates} == {0}


@pytest.fixture(scope="module")
def homecoming():
    """A walk that is lost, goes on elsewhere and comes back, and the frame at which its two segments are merged."""
    there = shown([stroll(k / 30.0) for k in range(30)])
    behind = shown([turned(stroll(k / 30.0), 2.6) for k in range(40)])
    back = shown([turned(stroll((40 + k) / 30.0), 2.6 - 0.04 * k) for k in range(64)])
    walk = in_order([*there, *blank(behind[:34]), *behind, *back])
    return walk, next(e.sequence for e in run(SMALL, walk).estimates for loop in e.loops if loop.accepted)


def test_odom_stays_put_where_a_segment_that_was_left_is_merged(homecoming):
    walk, merged = homecoming
    left = merged - 3
    ran = run(SMALL, in_order([*walk[:left], *walk[10:30]]))
    check_sanity(ran)
    assert [e.segment for e in ran.estimates[left - 1 : left + 1]] == [1, 0]
    assert any(loop.accepted for loop in ran.estimates[merged].loops)
    steps = [se3.inverse(a.T_odom_camera) @ b.T_odom_camera for a, b in pairwise(ran.estimates[left : merged + 5])]
    assert max(np.linalg.norm(se3.log(step)) for step in steps) < 0.02


def test_a_place_shown_by_the_last_frames_still_joins_the_map(homecoming):
    walk, merged = homecoming
    odometry = Odometry(SMALL, OdometrySettings())
    assert not any(loop.accepted for f in walk[:merged] for loop in odometry.process(f).loops)
    final = odometry.finish()
    assert any(loop.accepted for loop in odometry.late_loops)
    assert {pose.segment for pose in final} == {0}


def test_darkness_is_no_sight_and_the_first_glimpse_after_it_begins_nothing():
    walk = shown([stroll(k / 30.0) for k in range(20)])
    glimpse = shown([stroll(20 / 30.0)] * 3, OTHER_ROOM)
    ran = run(SMALL, in_order([*walk, *blank(walk[:1] * 45), *glimpse, *walk[10:]]))
    check_sanity(ran)
    assert set(ran.states[30:68]) == {State.LOST}
    assert {e.segment for e in ran.estimates} == {0}
    assert set(ran.states[-6:]) == {State.TRACKING}


@pytest.mark.parametrize(("period_s", "expected_s"), [(1 / 30, 2 / 30), (1.1, 2.0), (-3600.0, 0.0)])
def test_a_slow_stream_searches_too_and_a_step_back_in_time_is_no_search(period_s, expected_s):
    assert searched_s(searched_s(0.0, period_s), period_s) == pytest.approx(expected_s)
