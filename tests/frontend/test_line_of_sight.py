"""What stands in the way of landmarks, and which of their places are empty."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import SMALL, START
from sensor_models import sensor_model, view_of

from odom.frame import DepthModel, RgbdFrame
from odom.frontend.features.view import View
from odom.frontend.matching.line_of_sight import LineOfSight

SENSOR = sensor_model(SMALL)
AT_2_M = np.array([[0.0, 0.0, 2.0]])


def view(depth_mm) -> View:
    grey = np.zeros((SMALL.height, SMALL.width), np.uint8)
    return view_of(RgbdFrame(0, START, grey, START, np.asarray(depth_mm, np.uint16)))


def filled(depth_mm: int):
    return np.full((SMALL.height, SMALL.width), depth_mm)


def sight(depth_mm, points=AT_2_M) -> LineOfSight:
    covariances = np.tile(1e-5 * np.eye(3), (len(points), 1, 1))
    return LineOfSight.to(points, covariances, np.eye(4), view(depth_mm), SENSOR)


@pytest.mark.parametrize(
    ("depth_mm", "hidden", "seen_through"), [(1000, True, False), (2000, False, False), (3000, False, True)]
)
def test_depth_tells_what_is_hidden_and_what_is_gone(depth_mm: int, hidden: bool, seen_through: bool) -> None:
    found = sight(filled(depth_mm))
    assert (found.hidden[0], found.seen_through[0]) == (hidden, seen_through)


@pytest.mark.parametrize(("brightness", "is_washed_out"), [(60, False), (200, False), (252, True), (255, True)])
def test_where_all_is_white_nobody_could_find_anything(brightness: int, is_washed_out: bool) -> None:
    grey = np.full((SMALL.height, SMALL.width), brightness, np.uint8)
    lit = view_of(RgbdFrame(0, START, grey, START, np.asarray(filled(2000), np.uint16)))
    found = LineOfSight.to(AT_2_M, 1e-5 * np.eye(3)[None], np.eye(4), lit, SENSOR)
    assert found.washed_out[0] == is_washed_out
    middle = SMALL.height // 2, SMALL.width // 2
    grey[middle[0] - 8 : middle[0] + 9, middle[1] - 8 : middle[1] + 9] -= 60
    shaded = view_of(RgbdFrame(0, START, grey, START, np.asarray(filled(2000), np.uint16)))
    assert not LineOfSight.to(AT_2_M, 1e-5 * np.eye(3)[None], np.eye(4), shaded, SENSOR).washed_out[0]


def test_at_an_edge_of_the_depth_neither_is_said() -> None:
    edge = filled(3000)
    edge[:, : SMALL.width // 2 + 2] = 2000
    found = sight(edge)
    assert not found.hidden[0]
    assert not found.seen_through[0]


@pytest.mark.parametrize(
    ("model", "measured_mm"),
    [
        (DepthModel(scale=(0.7, 0.0, 0.0, 0.0, 0.0, 0.0)), 2000 / 0.7),
        (DepthModel(offset=(0.25, 0.0, 0.0, 0.0, 0.0, 0.0)), 1000 / (0.5 + 0.25)),
    ],
)
def test_a_landmark_is_there_where_depth_errs_as_the_calibration_says(model: DepthModel, measured_mm: float) -> None:
    sensor = sensor_model(replace(SMALL, depth=model))
    found = LineOfSight.to(AT_2_M, 1e-5 * np.eye(3)[None], np.eye(4), view(filled(round(measured_mm))), sensor)
    assert not (found.hidden | found.seen_through).any()


def test_depth_is_looked_up_where_the_calibration_says_that_it_lies() -> None:
    depth_mm = filled(3000)
    depth_mm[:, : SMALL.width // 2 - 20] = 2000
    sensor = sensor_model(replace(SMALL, depth=DepthModel(shift_px=(40.0, 0.0))))
    found = LineOfSight.to(AT_2_M, 1e-5 * np.eye(3)[None], np.eye(4), view(depth_mm), sensor)
    assert not found.seen_through[0]
    assert sight(depth_mm).seen_through[0]


def test_where_nothing_is_measured_or_looked_at_neither_is_said() -> None:
    found = sight(filled(0))
    assert not (found.hidden | found.seen_through).any()
    behind_and_outside = np.array([[0.0, 0.0, -2.0], [5.0, 0.0, 2.0]])
    found = sight(filled(3000), behind_and_outside)
    assert not (found.hidden | found.seen_through).any()


def test_a_landmark_known_roughly_is_not_said_to_be_gone() -> None:
    roughly = LineOfSight.to(AT_2_M, np.eye(3)[None] * 0.5**2, np.eye(4), view(filled(3000)), SENSOR)
    assert not roughly.seen_through[0]
