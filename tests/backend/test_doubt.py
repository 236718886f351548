"""What the covariance of a motion allows for while the camera may follow a body."""

from dataclasses import replace

import numpy as np
from made_up_scene import blank_view
from sensor_models import sensor_model

from odom.backend.doubt import Doubt
from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.map.map import Map
from odom.backend.odometry.published_trajectory import PublishedTrajectory
from odom.frame import Camera
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3

STILL = np.eye(4)
AWAY = np.array([0.3, -0.1, 0.0, 0.0, 0.2, 0.0])
SPREAD = 0.25 * np.outer(AWAY, AWAY)
"""The covariance of a velocity that is off by AWAY with probability a quarter."""


def lasting(frames: int, T=STILL, spread=SPREAD) -> list[Doubt]:
    every = [Doubt()]
    for _ in range(frames):
        every.append(every[-1].after(T, spread, 0.1))
    return every


def test_the_error_of_a_velocity_that_lasts_adds_up() -> None:
    every = lasting(10)
    assert np.allclose(every[10].since(every[0], STILL), SPREAD)
    assert np.allclose(every[10].since(every[5], STILL), 0.25 * SPREAD)


def test_it_stays_as_it_is_once_the_doubt_is_over() -> None:
    *_, last = lasting(10)
    later = last.after(STILL, None, 5.0)
    assert np.allclose(later.since(Doubt(), STILL), SPREAD)
    assert np.allclose(later.since(last, STILL), 0.0)
    assert not later.is_open


def test_without_doubt_there_is_exactly_nothing() -> None:
    later = Doubt().after(se3.exp(AWAY), None, 1.0)
    assert not later.since(Doubt(), se3.exp(AWAY)).any()


def test_it_turns_with_the_camera() -> None:
    T = se3.exp(np.array([0.1, 0.0, 0.2, 0.0, 0.5, 0.0]))
    before = lasting(1)[-1]
    after = before.after(T, None, 0.1)
    A = se3.adjoint(se3.inverse(T))
    assert np.allclose(after.since(Doubt(), T), A @ before.since(Doubt(), STILL) @ A.T)
    assert np.allclose(after.since(before, T), 0.0)


def test_once_the_camera_knows_its_place_again_only_the_earlier_pose_is_in_doubt() -> None:
    *_, middle, last = lasting(10)
    known = last.known_again()
    assert np.allclose(known.since(last, STILL), last.since(Doubt(), STILL))
    assert np.allclose(known.since(middle, STILL), middle.since(Doubt(), STILL))


def test_a_second_doubt_is_none_of_the_first_however_long_it_lasts() -> None:
    *_, first = lasting(2)
    second = first.known_again()
    for _ in range(10):
        second = second.after(STILL, SPREAD, 0.1)
    assert np.allclose(second.since(first, STILL), first.since(Doubt(), STILL) + SPREAD)
    assert (np.linalg.eigvalsh(second.since(first, STILL)) > -1e-12).all()


def test_doubt_before_a_new_segment_never_makes_a_later_motion_surer() -> None:
    """The camera was in doubt, lost, began a segment, found the first one again, and is in greater doubt there."""
    map_, sensor = Map(), sensor_model(Camera(64, 48, 60.0, 60.0, 31.5, 23.5))
    published = PublishedTrajectory(map_)

    def begun(number: int) -> Doubt:
        view = blank_view(number)
        at = map_.add_keyframe(view, STILL, MeasuredLandmarks.nothing(), ShutterTiming(), None, np.zeros((6, 6)))
        return published.begin(view, at, sensor).doubt

    before = begun(0).after(STILL, 0.01 * SPREAD, 1.0).known_again()
    published._newest = replace(published._newest, doubt=before)
    after = begun(1).after(STILL, SPREAD, 5.0)
    assert np.linalg.eigvalsh(after.since(before, STILL)).min() >= -1e-12
    assert after.resolved > before.resolved
