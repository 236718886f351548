"""Segments that are still apart when a run ends are tried against each other, by views that were kept for it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_scene import chain_of_keyframes

from odom.backend.estimate import LoopCandidate
from odom.backend.loop_closure import apart, loop_closure
from odom.backend.loop_closure.apart import KeptViews, recognised_apart
from odom.backend.loop_closure.candidate import ConfirmedCandidate
from odom.backend.loop_closure.loop_closure import LoopCloser
from odom.backend.loop_closure.tuning import TUNING
from odom.backend.map.keyframe import FrameObservations
from odom.backend.map.pose_graph import Edge
from odom.backend.mapping.described import DescribedKeyframe
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.frontend.matching.place_recognition import Recognition
from odom.geometry import se3

SMALL = np.diag([1e-6] * 3 + [1e-7] * 3)
SENSOR = SimpleNamespace(noise=SimpleNamespace(covariance_scale=1.0), clock=SimpleNamespace(steady=0))
STANDING = np.zeros((1, 2))
BEGINS = (0, 10, 20)
COUNT = 30


def view(number, standing=STANDING):
    return KeyframeView(number, None, np.zeros(6), standing)


def three_segments():
    """A map of three segments of ten key frames each, all where they truly are, with an (empty) place for each."""
    poses = [se3.exp(np.array([0.1 * k, 0.0, 0.0, 0.0, 0.01 * k, 0.0])) for k in range(COUNT)]
    map_ = chain_of_keyframes(poses, SMALL, BEGINS)
    map_.places.places = {number: SimpleNamespace() for number in range(COUNT)}
    return map_


def recognition(candidate, matches=40):
    inliers = np.ones(matches, np.bool_)
    return Recognition(candidate, SimpleNamespace(ok=True, inliers=inliers, T_target_source=np.eye(4), reason=""))


@pytest.fixture
def alike(monkeypatch):
    """What each key frame's place looks like, by number: to be filled in."""
    alike = {}

    def recognise(index, place, excluded, most):
        number = next(n for n, p in index.places.items() if p is place)
        return [one for one in alike.get(number, []) if one.candidate not in excluded][:most]

    monkeypatch.setattr(apart, "recognise", recognise)
    return alike


@pytest.fixture
def tracked(monkeypatch):
    """The pairs that were tracked: those of them that are ten apart were right."""
    pairs = []

    def track(map_, tracker, seen, place, sensor):
        a, b = place.candidate, seen.keyframe
        pairs.append((a, b))
        candidate = LoopCandidate(map_.keyframes[b].stamp, map_.keyframes[a].stamp, 0, False, "in vain")
        if abs(a - b) != 10:
            return candidate
        edge = Edge(a, b, map_.keyframes[a].T_camera_map @ se3.inverse(map_.keyframes[b].T_camera_map), SMALL)
        nothing = np.zeros(0, np.int64)
        seen_again = FrameObservations(
            rows=nothing,
            identities=nothing,
            measurements=map_.keyframes[b].measurements.take(nothing),
            timing=map_.keyframes[b].timing,
        )
        return ConfirmedCandidate(replace(candidate, accepted=True), edge, np.zeros((0, 2)), seen_again)

    monkeypatch.setattr(loop_closure, "track_candidate", track)
    return pairs


def test_views_in_doubt_are_kept_few_and_all_along_the_run():
    kept = KeptViews()
    for number in range(500):
        kept = kept.with_more([view(number, STANDING if number % 5 else None)])
    numbers = [one.keyframe for one in kept.views]
    assert all(number % 5 for number in numbers)
    assert len(numbers) == TUNING.kept_views
    assert (numbers[0], numbers[-1]) == (1, 499)
    assert np.diff(numbers).max() <= 3 * 500 / TUNING.kept_views


def test_the_surest_are_tried_first_and_none_of_a_views_own_segment(alike):
    map_ = three_segments()
    alike[3] = [recognition(5), recognition(12, 30), recognition(22, 5)]  # too few matches agree on the last
    alike[25] = [recognition(15, 50)]
    found = recognised_apart(map_, [view(3), view(25)])
    assert [(seen.keyframe, one.candidate) for seen, one in found] == [(25, 15), (3, 12)]


def test_at_the_end_older_views_find_what_was_seen_later_and_segments_are_merged(alike, tracked):
    map_ = three_segments()
    closer = LoopCloser(map_, None)
    closer.judge([DescribedKeyframe(view(number), None, []) for number in (3, 4, 15)], SENSOR)
    assert not closer.close(7, SENSOR)
    alike.update({3: [recognition(13, 60)], 4: [recognition(11, 90), recognition(14, 30)], 15: [recognition(25)]})
    decided = closer.close(None, SENSOR)
    assert [one.accepted for one in decided] == [False, True, True]
    assert {keyframe.segment for keyframe in map_.keyframes} == {0}
    assert tracked == [(11, 4), (13, 3), (25, 15)]  # 4 and 14 were in one segment by then
    assert not closer.close(None, SENSOR)


def test_of_a_run_that_did_not_fall_apart_nothing_is_tried(alike, tracked):
    map_ = chain_of_keyframes([np.eye(4)] * COUNT, SMALL)
    closer = LoopCloser(map_, None)
    closer.judge([DescribedKeyframe(view(3), None, [])], SENSOR)
    alike[3] = [recognition(13)]
    assert not closer.close(None, SENSOR)
    assert not tracked
