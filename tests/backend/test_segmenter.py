"""Someone's masks of what may move: used where they can be right, ignored and counted where they cannot."""

from collections.abc import Callable

import numpy as np
import pytest
from carrier import carried, carrier_mask
from painted_room import SMALL, PaintedRoom, stroll

from odom import Odometry, RgbdFrame, State

ROOM = PaintedRoom()
FRAMES = [ROOM.frame(SMALL, 2 * number, stroll(number / 15)) for number in range(8)]
SHAPE = (SMALL.height, SMALL.width)


def left_half(frame: RgbdFrame):
    return np.arange(SMALL.width) < SMALL.width // 2 + np.zeros(SHAPE, int)


def failing(frame: RgbdFrame):
    raise RuntimeError("no such model")


def run(segmenter: Callable | None) -> tuple[Odometry, list]:
    odometry = Odometry(SMALL, segmenter=segmenter)
    return odometry, [odometry.process(frame) for frame in FRAMES]


@pytest.mark.parametrize("kind", [np.bool_, np.uint8])
def test_no_feature_lies_on_what_is_marked_and_the_camera_is_tracked_by_the_rest(kind: type) -> None:
    odometry, estimates = run(lambda frame: left_half(frame).astype(kind))
    assert all(estimate.state is State.TRACKING for estimate in estimates)
    for estimate in estimates[1:]:
        assert estimate.features.uv[:, 0].min() >= SMALL.width // 2 - 1
    assert not odometry.segmentation.ignored


@pytest.mark.parametrize(
    ("segmenter", "reason"),
    [
        (lambda frame: np.ones(SHAPE, bool), "the whole view is masked"),
        (lambda frame: None, "no mask"),
        (lambda frame: np.zeros((48, 64), bool), "a mask of shape (48, 64): give (240, 320), that of the colour image"),
        (lambda frame: np.zeros(SHAPE), "a mask of float64: give a numpy array of bool or uint8"),
        (lambda frame: [[True]], "a mask of list: give a numpy array of bool or uint8"),
        (failing, "the segmenter raised RuntimeError: no such model"),
    ],
)
def test_a_mask_that_cannot_be_right_is_ignored_and_counted(segmenter: Callable, reason: str) -> None:
    odometry, estimates = run(segmenter)
    plain = run(None)[1]
    assert odometry.segmentation.ignored == {reason: len(FRAMES)}
    for one, other in zip(estimates, plain, strict=True):
        assert np.array_equal(one.T_odom_camera, other.T_odom_camera)


def test_a_mask_of_nothing_changes_nothing() -> None:
    odometry, estimates = run(lambda frame: np.zeros(SHAPE, bool))
    assert not odometry.segmentation.ignored
    for one, other in zip(estimates, run(None)[1], strict=True):
        assert np.array_equal(one.T_odom_camera, other.T_odom_camera)


def test_reasons_that_differ_each_time_are_bounded() -> None:
    odometry = Odometry(SMALL, segmenter=lambda frame: np.zeros((frame.sequence % 50 + 1, 3), bool))
    for number in range(40):
        odometry.segmentation.mask(ROOM.frame(SMALL, number, np.eye(4)))
    assert len(odometry.segmentation.ignored) <= 17
    assert odometry.segmentation.ignored.total() == 40


def test_what_carries_the_camera_is_no_moving_body_where_it_is_marked() -> None:
    odometry, states = Odometry(SMALL, segmenter=lambda frame: carrier_mask(frame, 0.4)), []
    for number in range(0, 90, 2):
        estimate = odometry.process(carried(ROOM.frame(SMALL, number, stroll(number / 30)), 0.4))
        states.append(estimate.state)
        assert estimate.moving is None or not estimate.moving.mask.any()
    assert set(states) == {State.TRACKING}
