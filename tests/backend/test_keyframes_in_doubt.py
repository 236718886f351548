"""Among people, what was not seen to stand bears no landmarks, so that no body becomes the scene."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from made_up_scene import blank_view, chain_of_keyframes
from painted_room import SMALL, PaintedRoom

from odom.backend.loop_closure import candidate
from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.mapping.described import PlaceSearch
from odom.backend.mapping.keyframe_inserter import KeyframeInserter, KeyframeView
from odom.backend.mapping.mapper import Mapper
from odom.backend.mapping.standing import RecentViews
from odom.backend.odometry.unproven_sensor import unproven_sensor
from odom.backend.settings import OdometrySettings
from odom.frame import Stamp
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.images import FrameImages
from odom.frontend.features.measurement import measure_exactly
from odom.frontend.features.view import View
from odom.frontend.matching.tuning import TUNING as PLACES
from odom.geometry import se3

POSES = [se3.exp(np.array([0.1 * k, 0.0, 0.0, 0.0, 0.0, 0.0])) for k in range(4)]
"""T_map_camera of key frames a second apart, with 20 landmarks each."""


@pytest.mark.parametrize(
    ("after_s", "of_keyframes", "is_due"),
    [(0.1, (2, 3), False), (0.1, (1, 2), True), (0.6, (2, 3), True), (0.6, (3,), False)],
)
def test_a_view_in_doubt_becomes_a_key_frame_by_what_has_been_known_for_a_while(
    after_s: float, of_keyframes: tuple[int, ...], is_due: bool
) -> None:
    assert is_due_in_doubt(POSES, after_s, of_keyframes) == is_due


def test_a_young_segment_grows_by_what_is_new_since_it_has_nothing_else() -> None:
    assert is_due_in_doubt(POSES[:2], 0.1, (1,))


@pytest.mark.parametrize(("of_keyframes", "is_due"), [((3,), False), ((1, 2), True)])
def test_in_a_map_of_later_stamps_nothing_is_young_and_what_was_saved_is_old(
    of_keyframes: tuple[int, ...], is_due: bool
) -> None:
    """An older recording is played onto a newer map: the last key frame is the run's own."""
    assert is_due_in_doubt(POSES, 0.1, of_keyframes, saved=3, saved_later_s=1000.0) == is_due


@pytest.mark.parametrize(("of_keyframes", "is_due"), [((3,), False), ((2, 3), True)])
def test_after_a_step_back_of_the_stamps_what_was_before_is_old(of_keyframes: tuple[int, ...], is_due: bool) -> None:
    assert is_due_in_doubt(POSES, -60.0, of_keyframes) == is_due


def is_due_in_doubt(
    poses: list[np.ndarray], after_s: float, of_keyframes: tuple[int, ...], saved: int = 0, saved_later_s: float = 0.0
) -> bool:
    """Whether a view so long after the last key frame becomes one, where the landmarks `of_keyframes` agree with it.

    The first `saved` key frames are of an earlier run, with stamps that are so much later.
    """
    map_, last = chain_of_keyframes(poses, np.eye(6)), len(poses) - 1
    for keyframe in map_.keyframes[:saved]:
        keyframe.frame, keyframe.stamp = -1, Stamp(keyframe.stamp + round(1e9 * saved_later_s))
    rows = np.flatnonzero(np.isin(map_.landmarks.keyframe, of_keyframes))
    inserter = KeyframeInserter(map_, OdometrySettings())
    inserter.want_keyframe()
    stamp = Stamp(round(1e9 * (last + after_s)))
    view = replace(blank_view(last + 1), stamp=stamp, steady_stamp=SteadyStamp(stamp))
    seen = SimpleNamespace(rows=rows, uv=np.zeros((len(rows), 2)))
    T_camera_map = se3.inverse(poses[last] @ se3.exp(np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0])))
    tracked = cast("Any", SimpleNamespace(inlier_landmarks=seen, reference=last, T_camera_map=T_camera_map))
    assert inserter.is_due(view, tracked, in_doubt=False)
    return inserter.is_due(view, tracked, in_doubt=True)


@pytest.mark.parametrize("in_doubt", [False, True])
def test_in_doubt_no_corner_that_nothing_can_judge_becomes_a_landmark(in_doubt: bool) -> None:
    frame = PaintedRoom().frame(SMALL, 0, np.eye(4))
    sensor = unproven_sensor(SMALL, OdometrySettings()).with_stamp(frame.stamp)
    view = View.of(frame, 0, sensor.clock, FrameImages.of(frame.color), None)
    map_ = chain_of_keyframes(POSES[:1], np.eye(6))
    corners = KeyframeInserter(map_, OdometrySettings()).first_corners(view, sensor)
    assert corners is not None
    nothing = SimpleNamespace(uv=np.zeros((0, 2)))
    tracked = cast("Any", SimpleNamespace(twist=np.zeros(6), inlier_landmarks=nothing, inlier_count=0, reference=0))
    stands, _ = (
        RecentViews(map_).compared_with(view, tracked).standing(corners, sensor, in_doubt)
    )  # no view before this one
    assert stands.mean() == (0.0 if in_doubt else 1.0)


@pytest.mark.parametrize("in_doubt", [False, True])
def test_in_doubt_a_place_is_what_stands_there_which_is_known_when_new_corners_are(in_doubt: bool) -> None:
    frame = PaintedRoom().frame(SMALL, 0, np.eye(4))
    sensor = unproven_sensor(SMALL, OdometrySettings()).with_stamp(frame.stamp)
    view = View.of(frame, 0, sensor.clock, FrameImages.of(frame.color), None)
    map_ = chain_of_keyframes(POSES, np.eye(6))
    mapper = Mapper(map_, OdometrySettings(), sensor)
    rows = np.arange(len(map_.landmarks.alive[map_.landmarks.alive]))
    uv = np.tile([40.0, 30.0], (len(rows), 1))
    tracked = cast(
        "Any", SimpleNamespace(T_camera_map=np.eye(4), reference=3, twist=np.zeros(6), inlier_count=len(rows))
    )
    tracked.inlier_landmarks = MeasuredLandmarks(rows, uv, measure_exactly(view, sensor, uv, np.zeros(6)))
    tracked.displaced = MeasuredLandmarks.nothing()
    mapper.inserter.insert(view, tracked, np.zeros(6), np.eye(6), sensor, 0, in_doubt)
    assert len(mapper.inserter.undescribed) == (0 if in_doubt else 1)
    assert mapper.inserter.insert_found_corners(None, sensor) is not None
    (seen,) = mapper.inserter.undescribed
    if in_doubt:
        assert seen.standing is not None
        assert np.array_equal(seen.standing, map_.keyframes[-1].uv)
    else:
        assert seen.standing is None


@pytest.mark.parametrize(
    ("in_doubt", "found_again", "is_known"), [(True, 15, True), (False, 15, False), (True, 8, False)]
)
def test_a_place_of_what_stands_among_people_is_known_by_fewer_landmarks_where_they_agree_with_descriptors(
    monkeypatch: pytest.MonkeyPatch, in_doubt: bool, found_again: int, is_known: bool
) -> None:
    map_ = chain_of_keyframes(POSES, np.eye(6), begins=(0, 3))
    old, new = map_.keyframes[0], map_.keyframes[3]
    T_old_new = old.T_camera_map @ se3.inverse(new.T_camera_map)
    registration = SimpleNamespace(
        ok=True, inliers=np.ones(30, np.bool_), T_target_source=T_old_new, covariance=np.eye(6)
    )
    tracked = SimpleNamespace(
        found_again=found_again,
        visible_count=100,  # most are hidden by people
        T_camera_map=new.T_camera_map,
        T_map_camera=se3.inverse(new.T_camera_map),
        covariance=np.eye(6),
        reference=0,
        inlier_landmarks=SimpleNamespace(rows=np.arange(3), measurements=None, uv=np.zeros((3, 2))),
    )
    monkeypatch.setattr(candidate, "track_place", lambda *_: tracked)
    sensor = cast("Any", SimpleNamespace(
        noise=SimpleNamespace(covariance_scale=1.0), clock=SimpleNamespace(period_s=0.03), timing=None
    ))  # fmt: skip
    seen = KeyframeView(3, cast("Any", None), np.zeros(6), np.zeros((1, 2)) if in_doubt else None)
    recognition = cast("Any", SimpleNamespace(candidate=0, registration=registration))
    found = candidate.track_candidate(map_, cast("Any", None), seen, recognition, sensor)
    assert isinstance(found, candidate.ConfirmedCandidate) == is_known


def test_in_doubt_other_segments_places_come_first_and_more_of_them() -> None:
    map_ = chain_of_keyframes(POSES, np.eye(6), begins=(0, 3))
    looks = [
        PlaceSearch.of(map_, KeyframeView(3, cast("Any", None), np.zeros(6), standing)).rounds
        for standing in (None, np.zeros((1, 2)))
    ]
    assert looks[0] == [(map_.linked(3), PLACES.place_candidates)]
    (apart, most), (mine, _) = looks[1]
    assert most > PLACES.place_candidates
    assert apart.isdisjoint({0, 1, 2})
    assert 3 in apart
    assert mine.issuperset({0, 1, 2})
