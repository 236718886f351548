"""A camera that turns round in a room until it is where it began: what a closure is judged by, and what it changes."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import SMALL
from rounds import ROUND, round_and_more

from odom.backend import Odometry, State
from odom.backend.loop_closure.candidate import track_place
from odom.backend.map.shown import ShownPath
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.geometry import se3


@pytest.fixture(scope="module")
def frames():
    return round_and_more(ROUND + 20)


@pytest.fixture(scope="module")
def walked(frames):
    """The odometry after a round, and its estimates."""
    odometry = Odometry(SMALL)
    return odometry, [odometry.process(frame) for frame in frames]


def test_a_place_is_known_again_by_what_others_saw_there_not_by_the_key_frame_itself(walked):
    odometry, _ = walked
    stages, state = odometry._stages, odometry._stages.last
    map_, tracker, sensor = stages.map, stages.tracker, stages.sensor
    newest = map_.keyframes[-1]
    seen = KeyframeView(newest.number, state.view, state.tracked.twist)
    own = map_.linked(newest.number)
    beyond = {far for near in own for far in map_.links[near]} - own
    assert beyond
    for candidate in sorted(beyond):
        anchors = map_.landmarks.keyframe
        local = tracker.around(candidate, newest.T_camera_map)
        all_around = tracker.track(seen.view, sensor, newest.T_camera_map, seen.twist, local)
        judged = track_place(map_, tracker, seen, candidate, newest.T_camera_map, sensor)
        assert own & set(anchors[all_around.looked_for].tolist())
        assert not own & set(anchors[judged.looked_for].tolist())


def test_the_test_of_a_closed_walk_is_of_its_last_frame_or_is_not_made(frames):
    dark = [replace(f, color=np.zeros_like(f.color)) for f in frames[ROUND : ROUND + 10]]
    ends = {}
    for name, last in (("seen", frames[ROUND : ROUND + 10]), ("dark", dark)):
        odometry = Odometry(SMALL)
        states = [odometry.process(frame).state for frame in [*frames[:ROUND], *last]]
        odometry.finish()
        ends[name] = states[-1], odometry.closing_test()
    assert ends["seen"][0] is State.TRACKING
    assert ends["seen"][1] is not None
    assert ends["dark"] == (State.LOST, None)


def test_the_path_has_each_key_frame_where_its_pose_was_published(frames):
    """But for the smoothing of what is published, which is small beside the pose's sigma.

    The path is looked at as soon as a key frame is made: until it is sent, the map may be adjusted.
    """
    odometry, away = Odometry(SMALL), []
    for estimate in map(odometry.process, frames):
        if estimate.is_keyframe and estimate.step is not None:
            at = {pose.stamp: pose.T_map_camera for pose in ShownPath().of(odometry.map)}
            T_map_camera = estimate.T_map_odom @ estimate.T_odom_camera
            away.append(se3.log(se3.inverse(T_map_camera) @ at[estimate.stamp]))
            assert away[-1] @ np.linalg.solve(estimate.covariance, away[-1]) < 1.0
    assert len(away) > 10
    metres, radians = (np.linalg.norm(np.array(away)[:, part], axis=1) for part in (slice(3), slice(3, 6)))
    assert np.median(metres) < 0.001
    assert np.median(radians) < 0.001


def test_every_key_frame_is_in_the_next_path_that_is_shown(walked):
    _, estimates = walked
    made = []
    for estimate in estimates:
        made += [estimate.stamp] if estimate.is_keyframe else []
        if estimate.path is not None:
            assert set(made) <= {pose.stamp for pose in estimate.path}
            made = []
    assert made == []


def test_odom_is_none_the_surer_by_a_closure_that_it_does_not_follow(walked):
    _, estimates = walked
    closed = next(i for i, e in enumerate(estimates) if any(loop.accepted for loop in e.loops))
    traces = [np.trace(e.covariance[:3, :3]) for e in estimates]
    assert min(traces[closed:]) > 0.8 * traces[closed - 1]
