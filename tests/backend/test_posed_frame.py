"""Where the newest frame expects the next pose."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from made_up_scene import bare_keyframe, blank_view, exact

from odom.backend.map.map import Map
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.geometry import se3

PERIOD_S = 0.03
ASIDE = se3.exp(np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]))
BEGINNING = PosedFrame.at_beginning(blank_view(0), np.eye(4), bare_keyframe(0, np.eye(4)))


def frame_after(seconds: float, disputed_s: float | None = None) -> PosedFrame:
    """The frame of a camera at rest, so many seconds after its segment began; its pose is disputed for `disputed_s`."""
    stamp = round(1e9 * seconds)
    since = None if disputed_s is None else SteadyStamp(stamp - round(1e9 * disputed_s))
    view, tracked = replace(blank_view(1), steady_stamp=SteadyStamp(stamp)), SimpleNamespace(disputed_since=since)
    return replace(BEGINNING, view=view, tracked=cast(Any, tracked), is_bent=False)


def test_after_a_segments_first_frame_the_camera_may_be_as_far_as_a_hand_moves_it() -> None:
    expected = BEGINNING.expected_after(PERIOD_S)
    assert expected.free[0] == TUNING.velocity_sigma_m_s * PERIOD_S
    assert not expected.is_within_reach(ASIDE)


def test_shortly_after_a_segment_began_its_pose_is_as_unsure_as_if_the_velocity_had_not_been_known() -> None:
    assert frame_after(0.2).expected_after(PERIOD_S).is_within_reach(ASIDE)


def test_the_longer_features_have_disagreed_with_the_pose_the_farther_the_camera_may_be_from_where_it_leads() -> None:
    assert not frame_after(10.0, 0.0).expected_after(PERIOD_S).is_within_reach(ASIDE)
    assert frame_after(10.0, 0.2).expected_after(PERIOD_S).is_within_reach(ASIDE)


@pytest.mark.parametrize("since_begun_s", [TUNING.young_s + PERIOD_S, -10.0])
def test_later_and_where_time_went_back_only_a_jerk_takes_the_camera_from_where_it_is_expected(
    since_begun_s: float,
) -> None:
    expected = frame_after(since_begun_s).expected_after(PERIOD_S)
    assert expected.free[0] == TUNING.jerk_m_s2 * PERIOD_S**2
    assert not expected.is_within_reach(ASIDE)


def test_a_frame_that_moves_with_the_map_has_one_pose() -> None:
    none, nothing = np.zeros(0, dtype=np.int64), exact(np.zeros((0, 3)))
    found = none, np.zeros((0, 2)), nothing, np.zeros((0, 2)), np.zeros(0, dtype=np.bool_), none, none, none
    tracked = TrackedFrame(ASIDE, np.eye(6), *found, cast(Any, None), 0, np.zeros(6), None)
    frame = replace(BEGINNING, T_camera_map=ASIDE, tracked=tracked)
    map_ = Map(keyframes=[bare_keyframe(0, np.eye(4))])
    T_reference_camera = frame.T_reference_camera(map_)
    map_.keyframes[0].T_camera_map = se3.exp(np.array([0.0, 0.2, 0.0, 0.0, 0.1, 0.0]))
    moved = frame.moved_with(map_, T_reference_camera)
    assert moved.tracked is not None
    np.testing.assert_array_equal(moved.tracked.T_camera_map, moved.T_camera_map)
    np.testing.assert_allclose(moved.T_reference_camera(map_), T_reference_camera, atol=1e-12)
