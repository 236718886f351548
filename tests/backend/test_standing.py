"""Which corners become landmarks, by what earlier views say of them and of their neighbours."""

import numpy as np

from odom.backend.mapping.standing import Evidence, moved_share, standing_score
from odom.backend.mapping.tuning import TUNING
from odom.frontend.matching.look_back import Sighting

WALL = np.column_stack([np.linspace(-1.0, 1.0, 40), np.zeros(40), np.full(40, 2.0)])
BODY = np.column_stack([np.linspace(-0.2, 0.2, 20), np.full(20, 0.3), np.full(20, 1.0)])
POINTS = np.concatenate([WALL, BODY])
ON_BODY = np.arange(60) >= 40


NONE = np.zeros(60, bool)


def evidence(stands, moves, missed=NONE, age_s: float = 0.3) -> Evidence:
    return Evidence.nothing(60).joined(Sighting(stands | moves | missed, stands, moves), age_s)


def test_what_moves_is_refused_and_what_stands_becomes_landmarks() -> None:
    kept = standing_score(POINTS, evidence(~ON_BODY, ON_BODY)) > 0.0
    assert (kept == ~ON_BODY).all()


def test_what_was_not_seen_before_goes_with_what_it_is_a_part_of() -> None:
    seen = np.arange(60) % 2 == 0
    kept = standing_score(POINTS, evidence(~ON_BODY & seen, ON_BODY & seen)) > 0.0
    assert (kept == ~ON_BODY).all()


def test_a_body_that_just_turns_round_is_told_by_its_older_views() -> None:
    turning = evidence(~ON_BODY, ON_BODY, age_s=0.4).joined(Sighting(~NONE, ~NONE, NONE), 0.03)
    assert ((standing_score(POINTS, turning) > 0.0) == ~ON_BODY).all()


def test_in_doubt_a_body_that_turned_round_before_it_was_missed_does_not_surely_stand() -> None:
    missed = evidence(~ON_BODY, NONE, ON_BODY, age_s=0.5).joined(Sighting(~NONE, ~NONE, NONE), 0.03)
    elsewhere = np.column_stack([np.linspace(-1.0, 1.0, 15), np.full(15, -0.5), np.full(15, 1.5)])  # it moves meanwhile
    nothing = Evidence.nothing(15).joined(Sighting(np.ones(15, bool), np.zeros(15, bool), np.ones(15, bool)), 0.5)
    both = Evidence(*(np.concatenate(pair) for pair in zip(vars(missed).values(), vars(nothing).values(), strict=True)))
    points = np.concatenate([POINTS, elsewhere])
    wall, body = np.arange(75) < 40, (np.arange(75) >= 40) & (np.arange(75) < 60)
    assert (standing_score(points, both)[body] > 0.0).all()
    surely = standing_score(points, both, in_doubt=True) > TUNING.standing_least
    assert surely[wall].all()
    assert not surely[~wall].any()


def test_in_doubt_what_no_view_saw_and_what_one_saw_a_moment_ago_do_not_surely_stand() -> None:
    just_now = Evidence.nothing(60).joined(Sighting(~ON_BODY, ~ON_BODY, NONE), 0.03)
    assert (standing_score(POINTS, just_now) > 0.0).all()
    assert not (standing_score(POINTS, just_now, in_doubt=True) > TUNING.standing_least).any()
    before = just_now.joined(Sighting(~ON_BODY, ~ON_BODY, NONE), 0.3)
    surely = standing_score(POINTS, before, in_doubt=True) > TUNING.standing_least
    assert (surely & ~ON_BODY == ~ON_BODY).all()
    assert (standing_score(POINTS, Evidence.nothing(60), in_doubt=True) == 0.0).all()


def test_single_false_matches_cost_themselves_only() -> None:
    false = np.isin(np.arange(60), [3, 17, 29])
    assert ((standing_score(POINTS, evidence(~false, false)) > 0.0) == ~false).all()


def test_without_any_view_or_any_movement_every_corner_is_kept() -> None:
    assert (standing_score(POINTS, Evidence.nothing(60)) > 0.0).all()
    assert (standing_score(POINTS, evidence(NONE, NONE, ~NONE)) > 0.0).all()
    assert standing_score(np.zeros((0, 3)), Evidence.nothing(0)).shape == (0,)


def corners_of(parts: int, each: int) -> np.ndarray:
    """Corners (px) of so many parts of an image, `each` of them in one."""
    uv = np.stack(np.meshgrid(np.arange(parts) * 64.0 + 1.0, np.arange(each) * 10.0), axis=-1)
    return uv.transpose(1, 0, 2).reshape(-1, 2)


def test_the_share_of_the_view_that_moved_is_that_of_its_parts_not_that_of_its_corners() -> None:
    uv = np.concatenate([corners_of(10, 3), np.tile([[30.0, 30.0]], (300, 1))])  # many on a print in the first part
    moved = np.concatenate([np.zeros(30, bool), np.ones(300, bool)])
    assert moved_share(uv, moved) == 0.1


def test_most_corners_decide_for_a_part() -> None:
    uv = corners_of(10, 5)
    assert moved_share(uv, np.arange(50) % 5 < 3) == 1.0
    assert moved_share(uv, np.arange(50) % 5 < 2) == 0.0


def test_too_few_corners_do_not_tell_how_much_moved() -> None:
    assert moved_share(np.zeros((0, 2)), np.zeros(0, bool)) == 0.0
    assert moved_share(corners_of(4, 9), np.ones(36, bool)) == 0.0
    assert moved_share(corners_of(20, 2), np.ones(40, bool)) == 0.0
