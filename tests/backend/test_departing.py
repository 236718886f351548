"""What begins to move is left out as a whole, also those of its landmarks that happen to agree with the pose."""

import numpy as np
import pytest

from odom.backend.tracking.departing import departing
from odom.backend.tracking.tuning import TUNING
from odom.geometry.arrays import Array, Mask

EYE = np.zeros(3)


@pytest.fixture
def points() -> Array:
    """250 points of a wall and what stands before it, then 90 of a body nearer by."""
    rng = np.random.default_rng(0)
    wall = rng.uniform((-2.0, -1.5, 2.8), (2.0, 1.5, 3.4), (250, 3))
    body = rng.uniform((-0.25, -0.45, 1.4), (0.25, 0.45, 1.6), (90, 3))
    return np.concatenate([wall, body])


def agreeing(wall: float, body: float) -> Mask:
    return np.random.default_rng(1).uniform(size=340) < np.repeat([wall, body], [250, 90])


def test_a_body_that_sets_off_departs_with_those_of_its_landmarks_that_happen_to_agree(points: Array) -> None:
    agrees = agreeing(0.8, 0.35)
    departs = departing(points, EYE, np.full(340, 0.9), agrees)
    assert departs[250:][agrees[250:]].mean() > 0.7
    assert departs[:250].mean() < 0.03


def test_landmarks_that_were_hardly_ever_found_are_no_surprise(points: Array) -> None:
    departs = departing(points, EYE, np.repeat([0.9, 0.4], [250, 90]), agreeing(0.8, 0.35))
    assert not departs[250:].any()


def test_nothing_departs_where_all_is_found_as_often_as_before(points: Array) -> None:
    assert not departing(points, EYE, np.full(340, 0.7), agreeing(0.7, 0.7)).mean() > 0.03


@pytest.mark.parametrize("n", [0, 1, TUNING.departing_neighbours])
def test_few_landmarks_tell_nothing(points: Array, n: int) -> None:
    assert not departing(points[:n], EYE, np.ones(n), np.zeros(n, dtype=np.bool_)).any()


def test_sparse_landmarks_have_other_things_for_neighbours(points: Array) -> None:
    few = np.arange(0, 340, 8)
    assert not departing(points[few], EYE, np.full(len(few), 0.9), agreeing(0.8, 0.0)[few]).any()
