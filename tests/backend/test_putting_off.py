"""What may close a loop waits for frames that have time, unless the chain contradicts it at the first glance."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_scene import chain_of_keyframes

from odom.backend.estimate import LoopCandidate
from odom.backend.loop_closure import loop_closure
from odom.backend.loop_closure.graph import SegmentGraph
from odom.backend.loop_closure.loop_closure import LoopCloser
from odom.backend.loop_closure.tuning import TUNING
from odom.backend.loop_closure.verification import contradiction, contradiction_from_start
from odom.backend.map.pose_graph import Edge
from odom.backend.mapping.described import DescribedKeyframe
from odom.frontend.matching.place_recognition import Recognition
from odom.geometry import se3

SMALL = np.diag([1e-6] * 3 + [1e-7] * 3)
COUNT = 30
SENSOR = SimpleNamespace(noise=SimpleNamespace(covariance_scale=1.0, calibration_error=0.0))
HERE, ELSEWHERE = np.eye(4), se3.exp(np.array([3.2, 0.0, 0.0, 0.0, 0.0, 0.0]))


def straight_on(begins=(0,)):
    poses = [se3.exp(np.array([0.1 * k, 0.0, 0.0, 0.0, 0.01 * k, 0.0])) for k in range(COUNT)]
    return chain_of_keyframes(poses, SMALL, begins)


def looks_like(map_, number, candidates, off=HERE):
    """Key frame `number` as it is recognised, from where it stands, or from `off` it."""
    found = []
    for candidate in candidates:
        T = map_.keyframes[candidate].T_camera_map @ se3.inverse(map_.keyframes[number].T_camera_map) @ off
        registration = SimpleNamespace(ok=True, inliers=np.ones(60, np.bool_), T_target_source=T, covariance=SMALL)
        found.append(Recognition(candidate, registration))
    return DescribedKeyframe(SimpleNamespace(keyframe=number, standing=None), None, found)


@pytest.fixture
def tracked(monkeypatch):
    """The pairs that were tracked: in vain."""
    pairs = []

    def in_vain(map_, tracker, seen, recognition, sensor):
        pairs.append((recognition.candidate, seen.keyframe))
        stamps = (map_.keyframes[n].stamp for n in (seen.keyframe, recognition.candidate))
        return LoopCandidate(*stamps, 0, False, "in vain")

    monkeypatch.setattr(loop_closure, "track_candidate", in_vain)
    return pairs


def test_a_place_that_the_chain_contradicts_is_refused_without_being_tracked(tracked):
    map_ = straight_on()
    closer = LoopCloser(map_, None)
    decided = closer.judge([looks_like(map_, 29, [3, 5], ELSEWHERE)], SENSOR)
    assert [one.accepted for one in decided] == [False, False]
    assert all(one.reason.startswith("contradicts the chain by 3.20 m") for one in decided)
    closer.work_on_waiting(1, SENSOR, has_time=True)
    assert not tracked


def test_what_may_close_a_loop_is_tracked_when_there_is_time_one_place_after_a_frame(tracked):
    map_ = straight_on()
    closer = LoopCloser(map_, None)
    assert not closer.judge([looks_like(map_, 28, [3, 5]), looks_like(map_, 29, [4])], SENSOR)
    assert not closer.work_on_waiting(1, SENSOR, has_time=False)
    assert not tracked
    for count in range(2, 6):
        assert len(closer.work_on_waiting(count, SENSOR, has_time=True)) == (count < 5)
    assert tracked == [(3, 28), (5, 28), (4, 29)]


def test_where_too_much_waits_time_is_taken(tracked):
    map_ = straight_on()
    closer = LoopCloser(map_, None)
    closer.judge([looks_like(map_, 20 + k, [3]) for k in range(TUNING.most_put_off)], SENSOR)
    assert not closer.work_on_waiting(1, SENSOR, has_time=False)
    closer.judge([looks_like(map_, 29, [3])], SENSOR)
    assert len(closer.work_on_waiting(2, SENSOR, has_time=False)) == 1
    assert tracked == [(3, 20)]


def test_a_place_in_another_segment_is_tracked_at_once(tracked):
    map_ = straight_on(begins=(0, 15))
    closer = LoopCloser(map_, None)
    assert len(closer.judge([looks_like(map_, 29, [3, 20])], SENSOR)) == 2
    assert tracked == [(3, 29), (20, 29)]


def test_at_the_end_nothing_waits_any_more(tracked):
    map_ = straight_on()
    closer = LoopCloser(map_, None)
    closer.judge([looks_like(map_, 28, [3, 5]), looks_like(map_, 29, [4])], SENSOR)
    sensor = SimpleNamespace(noise=SENSOR.noise, clock=SimpleNamespace(steady=0))
    assert len(closer.close(None, sensor)) == len(tracked) == 3


@given(st.integers(0, 10_000), st.floats(0.0, 0.1))
def test_what_contradicts_the_chain_by_way_of_its_start_contradicts_it(seed, size):
    map_, rng = straight_on(), np.random.default_rng(seed)
    a, b = sorted(rng.choice(COUNT, 2, replace=False).tolist())
    T = (
        map_.keyframes[a].T_camera_map
        @ se3.inverse(map_.keyframes[b].T_camera_map)
        @ se3.exp(size * rng.normal(size=6))
    )
    closure = Edge(a, b, T, SMALL, True)
    if contradiction_from_start(map_.keyframes[a], map_.keyframes[b], closure, 0.0):
        assert contradiction(SegmentGraph.of(map_, 0), closure, 0.0)


def test_key_frames_of_two_chains_contradict_none():
    map_ = straight_on(begins=(0, 15))
    closure = Edge(3, 29, ELSEWHERE, SMALL, True)
    assert not contradiction_from_start(map_.keyframes[3], map_.keyframes[29], closure, 0.0)
