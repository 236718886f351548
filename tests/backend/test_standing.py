"""Which corners become landmarks, by what earlier views say of them and of their neighbours."""

import numpy as np

from odom.backend.mapping.standing import Evidence, standing_corners
from odom.frontend.matching.look_back import Sighting

WALL = np.column_stack([np.linspace(-1.0, 1.0, 40), np.zeros(40), np.full(40, 2.0)])
BODY = np.column_stack([np.linspace(-0.2, 0.2, 20), np.full(20, 0.3), np.full(20, 1.0)])
POINTS = np.concatenate([WALL, BODY])
ON_BODY = np.arange(60) >= 40


NONE = np.zeros(60, bool)


def evidence(stands, moves, missed=NONE, age_s: float = 0.3) -> Evidence:
    return Evidence.nothing(60).joined(Sighting(stands | moves | missed, stands, moves), age_s)


def test_what_moves_is_refused_and_what_stands_becomes_landmarks() -> None:
    kept = standing_corners(POINTS, evidence(~ON_BODY, ON_BODY))
    assert (kept == ~ON_BODY).all()


def test_what_was_not_seen_before_goes_with_what_it_is_a_part_of() -> None:
    seen = np.arange(60) % 2 == 0
    kept = standing_corners(POINTS, evidence(~ON_BODY & seen, ON_BODY & seen))
    assert (kept == ~ON_BODY).all()


def test_a_body_that_just_turns_round_is_told_by_its_older_views() -> None:
    turning = evidence(~ON_BODY, ON_BODY, age_s=0.4).joined(Sighting(~NONE, ~NONE, NONE), 0.03)
    assert (standing_corners(POINTS, turning) == ~ON_BODY).all()


def test_single_false_matches_cost_themselves_only() -> None:
    false = np.isin(np.arange(60), [3, 17, 29])
    assert (standing_corners(POINTS, evidence(~false, false)) == ~false).all()


def test_without_any_view_or_any_movement_every_corner_is_kept() -> None:
    assert standing_corners(POINTS, Evidence.nothing(60)).all()
    assert standing_corners(POINTS, evidence(NONE, NONE, ~NONE)).all()
    assert standing_corners(np.zeros((0, 3)), Evidence.nothing(0)).shape == (0,)
