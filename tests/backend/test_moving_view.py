"""When a pose is in doubt since much of the view moves, and when it is sure again."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType, SimpleNamespace
from typing import Any, cast

import numpy as np

from odom.backend.odometry.moving_view import FOUND_IN_DOUBT, OTHER_MOTION, MovingView
from odom.backend.odometry.tuning import TUNING
from odom.backend.odometry.witnesses import Agreement, Witnesses
from odom.backend.tracking.other_motions import WhatElseMoves
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.matching.line_of_sight import LineOfSight
from odom.frontend.matching.moving_surfaces import MovingCells


@dataclass
class Shown:
    """Recent views before which a given share of the view moves; None: they cannot tell.

    Of its features, `as_one` follow one other motion, which may be that of the scene. Or else the camera's own is
    confirmed to be that. The share `behind` is the other motion's where that is of what lies behind. `is_denied`: what
    has no depth denies the camera's.
    """

    share: float | None
    as_one: float
    has_scene: bool = False
    is_confirmed: bool = False
    behind: float = 0.0
    is_denied: bool = False

    def moving(self, *_: object) -> MovingCells | None:
        return None if self.share is None else MovingCells(np.zeros((2, 2), bool), self.share, (8, 8))

    def what_else_moves(self, *_: object) -> WhatElseMoves | None:
        if self.share is None:
            return None
        return WhatElseMoves(
            self.as_one, self.share * np.eye(6), self.has_scene, self.is_confirmed, self.behind, self.is_denied
        )


def tracked_by(found: int, missed: int, is_contested: bool = False) -> tuple[Any, Any]:
    """A tracked frame and its landmarks, all of one age: old ones are `found` by the pose, others `missed`."""
    tracked = SimpleNamespace(
        rows=np.arange(found),
        inliers=np.ones(found, dtype=np.bool_),
        missed=np.arange(missed),
        is_contested=is_contested,
        sight=LineOfSight(*np.zeros((3, missed), dtype=np.bool_)),
    )
    identity, departed = np.zeros(100, dtype=np.int64), np.zeros(100, dtype=np.bool_)
    return tracked, SimpleNamespace(identity=identity, departed=departed, next_identity=1)


def told(
    shares: list[float | None],
    period_s: float = 0.1,
    found: int = 0,
    missed: int = 0,
    keyframes: Mapping[int, float] = MappingProxyType({}),
    lost: Collection[int] = (),
    as_one: Callable[[int], float] = lambda look: 0.2,
    scene_moves: Collection[int] = (),
    confirmed: Collection[int] = (),
    behind: Callable[[int], float] = lambda look: 0.0,
    denied: Collection[int] = (),
) -> list[MovingView]:
    """What is known after each look, `period_s` apart (see `tracked_by`).

    Looks that became `keyframes` had corners that moved in such a share of their view; before those in `lost` the view
    was lost. A share `as_one` of a look's features follows another motion; in `scene_moves` that is the scene's, in
    `confirmed` the camera's own is. A share `behind` follows another motion behind what moves with the camera, which
    is `denied` in some looks by what has no depth.
    """
    tracked, landmarks = tracked_by(found, missed)
    moving, every = MovingView(), []
    for i, share in enumerate(shares):
        stamp = SteadyStamp(round(1.001e9 * i * period_s))
        view = cast(Any, SimpleNamespace(steady_stamp=stamp))
        moving = (moving.restarted(0) if i in lost else moving).after(
            view,
            tracked,
            cast(Any, Shown(share, as_one(i), i in scene_moves, i in confirmed, behind(i), i in denied)),
            landmarks,
            cast(Any, None),
        )
        if i in keyframes:
            moving = moving.after_keyframe(stamp, keyframes[i], tracked, landmarks)
        every.append(moving)
    return every


def next_look(
    moving: MovingView,
    found: int,
    missed: int,
    as_one: float = 0.0,
    share: float = 0.0,
    is_contested: bool = False,
    scene_moves: bool = False,
) -> MovingView:
    """What is known after one more look in which a `share` of the view moves by its cells (see `told`)."""
    assert moving.stamp is not None
    tracked, landmarks = tracked_by(found, missed, is_contested)
    landmarks.next_identity = 50
    view = cast(Any, SimpleNamespace(steady_stamp=SteadyStamp(moving.stamp + 100_100_000)))
    return moving.after(view, tracked, cast(Any, Shown(share, as_one, scene_moves)), landmarks, cast(Any, None))


YOUNG, CALM = round(TUNING.moving_young_s * 10) + 2, round(TUNING.moving_calm_s * 10) + 2
STILL = [0.0] * max(YOUNG, CALM)


def test_a_scene_at_rest_is_never_in_doubt() -> None:
    assert not any(moving.doubt for moving in told(STILL))


def test_a_third_of_the_view_is_enough_at_the_start_and_not_later() -> None:
    assert told([0.33])[-1].is_doubtful
    assert not told([*STILL, 0.33])[-1].is_doubtful
    assert told([*STILL, 0.6])[-1].doubt == "60% of the view moved"


def test_the_doubt_of_the_start_ends_with_it_though_a_third_moves_on() -> None:
    shown = told([0.33] * 60)
    assert shown[YOUNG - 4].is_doubtful
    assert not shown[YOUNG].is_doubtful


def test_a_pose_is_sure_again_only_after_a_while_in_which_less_than_half_moved() -> None:
    after = told([*STILL, 0.6, *[0.3] * CALM])[len(STILL) :]
    assert all(moving.doubt == "most of the view moved" for moving in after[1 : CALM - 4])
    assert not after[-1].is_doubtful
    assert told([*STILL, 0.6, *[0.0] * (CALM - 4), 0.6, *[0.0] * (CALM - 4)])[-1].is_doubtful


def test_what_stood_still_before_tells_that_the_camera_was_not_taken_along() -> None:
    assert not told([*STILL, 0.6], found=60, missed=40)[-1].is_doubtful
    assert told([*STILL, 0.6], found=60, missed=80)[-1].is_doubtful
    assert told([*STILL, 0.6], found=20)[-1].is_doubtful
    assert told([0.6] * 40, found=60)[-1].is_doubtful  # nothing was seen before


def test_a_crowds_doubt_ends_where_what_stood_still_before_agrees_again() -> None:
    crowded = told([*STILL, 0.6], found=60, missed=80)[-1]
    assert crowded.is_doubtful
    assert next_look(crowded, 60, 80, share=0.3).is_doubtful
    assert not next_look(crowded, 60, 40, share=0.3).is_doubtful


def test_a_scene_is_at_rest_again_a_while_after_a_body_without_doubt_has_left_the_view() -> None:
    shown = told([*STILL, 0.3, *[0.0] * CALM], found=30)[len(STILL) - 1 :]
    assert not any(moving.is_doubtful for moving in shown)
    assert [moving.is_at_rest for moving in shown[:3]] == [True, False, False]
    assert shown[-1].is_at_rest


def test_views_that_cannot_tell_end_no_doubt() -> None:
    assert told([*STILL, 0.6, *[None] * 30])[-1].doubt == "most of the view moved"


BEGUN, LASTS = len(STILL), round(TUNING.moved_parts_s * 10)


def test_a_pose_is_in_doubt_from_a_key_frame_whose_corners_do_not_stand_until_one_whose_corners_do() -> None:
    shown = told([0.0] * (BEGUN + LASTS + 2), keyframes={BEGUN: 0.7})
    assert not shown[BEGUN - 1].is_doubtful
    assert all(moving.doubt == OTHER_MOTION for moving in shown[BEGUN + 1 : BEGUN + LASTS - 2])
    assert not shown[-1].is_doubtful
    assert not told([0.0] * (BEGUN + 3), keyframes={BEGUN: 0.7, BEGUN + 2: 0.1})[-1].is_doubtful
    assert not told([0.0] * (BEGUN + 3), keyframes={BEGUN: 0.4})[-1].is_doubtful


def test_landmarks_from_before_say_that_a_quick_turn_is_none_of_a_body_that_is_followed() -> None:
    assert not told([0.0] * (BEGUN + 1), found=60, missed=40, keyframes={BEGUN: 0.7})[-1].is_doubtful
    assert told([0.0] * (BEGUN + 3), found=60, missed=80, keyframes={BEGUN: 0.7})[-1].is_doubtful


def test_corners_that_do_not_stand_leave_no_doubt_where_nothing_else_moves_as_one() -> None:
    looks, keyframes = [0.0] * (BEGUN + LASTS), {BEGUN: 0.7, BEGUN + 4: 0.8}
    assert not any(moving.is_doubtful for moving in told(looks, keyframes=keyframes, as_one=lambda look: 0.0))
    assert not any(moving.is_doubtful for moving in told(looks, keyframes=keyframes, as_one=lambda look: 0.05))


def test_another_motion_that_not_every_look_shows_leaves_the_pose_in_doubt() -> None:
    shown = told([0.0] * (BEGUN + LASTS), keyframes={BEGUN: 0.7}, as_one=lambda look: 0.2 * (look % 5 == 0))
    assert all(moving.is_doubtful for moving in shown[BEGUN + 5 : -2])
    until = BEGUN + 10
    shown = told([0.0] * (BEGUN + LASTS), keyframes={BEGUN: 0.7}, as_one=lambda look: 0.2 * (look < until))
    assert shown[until + 5].is_doubtful
    assert not shown[until + 12].is_doubtful


def test_a_body_that_fills_the_view_from_the_start_leaves_doubt_as_long_as_the_rest_moves_as_one() -> None:
    shown = told(STILL * 2, as_one=lambda look: 0.5 * (look < len(STILL)))
    assert all(moving.is_doubtful for moving in shown[1 : len(STILL)])
    assert not shown[-1].is_doubtful
    between = told(STILL, as_one=lambda look: 0.5 * (look % 4 == 0))  # most looks cannot tell the two apart
    assert all(moving.is_doubtful for moving in between[5:])
    assert not any(moving.is_doubtful for moving in told(STILL, as_one=lambda look: 0.5 * (look == 4)))  # a quick turn
    late = told([*STILL, 0.0, 0.0], as_one=lambda look: 0.5 * (look >= len(STILL)), found=30)
    assert not late[-1].is_doubtful  # a quick turn of a camera that knows the scene


def test_a_smaller_motion_leaves_doubt_from_the_start_only_where_it_is_of_what_lies_behind() -> None:
    assert not any(moving.is_doubtful for moving in told(STILL, as_one=lambda look: 0.3))
    shown = told(STILL, as_one=lambda look: 0.3, behind=lambda look: 0.3)
    assert all(moving.is_doubtful for moving in shown[1:])


def test_what_has_no_depth_shows_by_two_looks_that_the_scene_is_left_behind() -> None:
    looks = told([0.0, 0.0], behind=lambda look: 0.9, denied=[0, 1])
    assert [moving.rivals.is_left_behind for moving in looks] == [False, True]
    assert not told([0.0, 0.0], behind=lambda look: 0.9)[-1].rivals.is_left_behind


def test_landmarks_that_stood_in_another_segment_do_not_speak_for_a_pose() -> None:
    n = len(STILL)
    known, unseen = (
        told([*STILL, 0.0, 0.0], behind=lambda i: 0.9 * (i >= n), denied=[n, n + 1], lost=[n], found=found)
        for found in (30, 0)
    )
    assert not known[-1].rivals.is_left_behind
    assert unseen[-1].rivals.is_left_behind


def test_after_a_loss_a_third_of_the_view_is_enough_again() -> None:
    assert told([*STILL, 0.33, *[0.0] * 3], lost=[len(STILL)])[-1].is_doubtful
    assert not told([*STILL, *[0.0] * 3, 0.33], lost=[len(STILL)], found=60, missed=40)[-1].is_doubtful
    assert not told(STILL * 2, lost=[len(STILL)])[len(STILL)].is_doubtful


def test_a_view_lost_in_doubt_is_not_sure_again_soon_though_nothing_seems_to_move() -> None:
    shown = told([*[0.6] * 10, *[0.0] * (LASTS + 3)], lost=[10], keyframes={10 + CALM: 0.0})
    assert all(moving.doubt == FOUND_IN_DOUBT for moving in shown[10 : 10 + LASTS - 1])
    assert not shown[-1].is_doubtful


def test_a_view_lost_in_doubt_is_sure_again_soon_where_landmarks_from_before_agree() -> None:
    shares = [*STILL, 0.6, *[0.0] * (CALM + 2)]
    assert not told(shares, lost=[len(STILL) + 1], found=60, missed=40)[-1].is_doubtful
    assert told(shares, lost=[len(STILL) + 1], found=20)[-1].is_doubtful


def test_what_was_seen_in_doubt_after_a_loss_proves_nothing() -> None:
    shares = [0.6, *[0.0] * (LASTS - 3)]
    assert told(shares)[-1].witnesses.proven_identity == 1
    assert told(shares, lost=[1])[-1].witnesses.proven_identity == 0


def test_the_velocity_is_unsure_as_long_as_the_pose_is_in_doubt() -> None:
    shown = told([*STILL, 0.6, None, *[0.1] * (CALM + 2)])
    assert all(moving.rivals.spread is None for moving in shown[: len(STILL)])
    doubtful = [moving for moving in shown if moving.is_doubtful]
    spreads = [moving.rivals.spread for moving in doubtful]
    assert [spread[0, 0] for spread in spreads[:2] if spread is not None] == [0.6, 0.6]
    assert spreads[-1] is not None
    assert 0.1 < spreads[-1][0, 0] < 0.11
    assert not shown[-1].is_doubtful
    assert shown[-1].rivals.spread is None


def test_a_look_that_shows_nothing_else_move_does_not_make_the_velocity_sure_at_once() -> None:
    before, after = (moving.rivals.spread for moving in told([*STILL, 0.6, 0.0])[-2:])
    assert before is not None
    assert after is not None
    assert 0.3 < after[0, 0] < before[0, 0]


def test_the_camera_knows_its_place_again_by_landmarks_from_before_the_doubt_alone() -> None:
    shares = [*STILL, 0.6, *[0.0] * (CALM + 3)]
    assert told(shares, found=60, missed=80)[-1].witnesses.is_rooted is False
    backed = told([*shares[:-1], 0.6], found=60, missed=40)
    assert not any(moving.is_doubtful for moving in backed)
    in_doubt = told([0.6, *[0.0] * (CALM + 20)], found=60)  # all it knows was seen in doubt
    assert in_doubt[-1].witnesses.is_rooted is False


def test_a_camera_from_which_the_scene_moves_away_follows_a_body() -> None:
    crowd, look = [*STILL, 0.6, 0.6, 0.6], len(STILL) + 1
    assert told(crowd, scene_moves=[look])[look].rivals.is_left_behind
    assert not told(crowd, scene_moves=[look])[look - 1].rivals.is_left_behind
    assert not told(crowd, scene_moves=[look])[look + 1].rivals.is_left_behind
    assert not told(crowd, found=60, missed=40, scene_moves=[look])[look].rivals.is_left_behind  # nobody looks


def test_a_pose_that_the_landmarks_from_before_contradict_is_looked_at_though_nothing_seems_to_move() -> None:
    look = len(STILL)

    def much(_: int) -> float:
        return 1.1 * TUNING.moved_rival

    contradicted = told([*STILL, 0.0], found=10, missed=90, scene_moves=[look])[look]
    assert contradicted.rivals.is_left_behind
    assert contradicted.is_doubtful
    for found, missed in ((30, 60), (60, 30)):
        assert not told([*STILL, 0.0], found=found, missed=missed, scene_moves=[look])[look].rivals.is_left_behind
    missed_more, missed_less = {"found": 40, "missed": 60}, {"found": 60, "missed": 40}
    assert not told([*STILL, 0.0], **missed_more, scene_moves=[look])[look].rivals.is_left_behind
    assert told([*STILL, 0.0, 0.0], **missed_more, scene_moves=[look, look + 1], as_one=much)[-1].rivals.is_left_behind
    assert not told([*STILL, 0.0, 0.0], **missed_less, scene_moves=[look, look + 1])[-1].rivals.is_left_behind
    assert not next_look(told(STILL)[-1], 10, 90).is_doubtful


AFTER_A_CROWD = [*STILL, 0.6, *[0.0] * CALM]


def test_where_the_scene_moves_away_landmarks_of_a_body_that_rested_and_sets_off_prove_nothing() -> None:
    calm, doubted = told(STILL)[-1], told(AFTER_A_CROWD)[-1]
    assert next_look(doubted, 60, 40, scene_moves=True).rivals.is_left_behind
    assert next_look(calm, 60, 40, scene_moves=True, is_contested=True).rivals.is_left_behind
    assert not next_look(calm, 60, 40, scene_moves=True).rivals.is_left_behind  # nobody looks


def test_soon_after_a_doubt_landmarks_that_contradict_the_pose_time_and_again_put_it_in_doubt_again() -> None:
    moving, calm = told(AFTER_A_CROWD)[-1], told(STILL)[-1]
    for look in range(TUNING.denied_looks):
        assert not moving.is_doubtful
        moving, calm = next_look(moving, 10, 90), next_look(calm, 10, 90)
        assert moving.witnesses.denying_looks == look + 1
    assert moving.is_doubtful
    assert next_look(moving, 60, 40).witnesses.denying_looks == 0
    assert not calm.is_doubtful


def test_soon_after_a_doubt_one_look_is_enough_in_which_next_to_none_of_the_landmarks_from_before_is_found() -> None:
    assert next_look(told(AFTER_A_CROWD)[-1], 5, 90).is_doubtful
    assert not next_look(told(STILL)[-1], 5, 90).is_doubtful


def test_what_is_made_while_landmarks_from_before_contradict_the_pose_proves_nothing() -> None:
    calm = told(AFTER_A_CROWD)[-1]
    assert calm.witnesses.proven_identity == 1
    assert next_look(calm, 60, 40).witnesses.proven_identity == 50
    assert next_look(calm, 10, 90).witnesses.proven_identity == 1


def test_a_pose_that_is_contradicted_while_much_else_moves_as_one_follows_a_body() -> None:
    much = 1.1 * TUNING.moved_rival
    once = next_look(told(AFTER_A_CROWD)[-1], 10, 90, much)
    assert once.is_doubtful
    assert not once.rivals.is_left_behind
    assert next_look(once, 10, 90, much).rivals.is_left_behind
    assert not next_look(once, 10, 90, 0.5 * TUNING.moved_rival).rivals.is_left_behind
    assert not next_look(once, 60, 40, much).rivals.is_left_behind


def test_after_a_body_was_followed_the_view_is_in_doubt_and_landmarks_count_anew() -> None:
    followed = told([*STILL, 0.0], found=10, missed=90, scene_moves=[len(STILL)])[-1]
    lost = followed.restarted(77)
    assert lost.is_doubtful
    assert not lost.rivals.is_left_behind
    assert lost.witnesses.fresh_identity == 77


def test_in_a_crowd_that_never_thins_landmarks_tell_once_the_scene_has_confirmed_the_camera_for_a_while() -> None:
    crowd, enough = [0.6] * 20, TUNING.confirmed_looks
    assert told(crowd, found=60)[-1].is_doubtful
    assert told(crowd, found=60, confirmed=range(enough - 1))[-1].is_doubtful
    assert not told(crowd, found=60, confirmed=range(0, 2 * enough, 2))[-1].is_doubtful
    assert told(crowd, found=60, missed=80, confirmed=range(enough))[-1].is_doubtful


def test_what_the_scene_has_confirmed_ends_the_doubt_of_a_key_frame_whose_corners_do_not_stand() -> None:
    crowd, confirmed = [0.6] * 20, range(TUNING.confirmed_looks)
    assert told(crowd, found=60, keyframes={10: 0.7})[-1].crowd.moved_keyframe_stamp is not None
    assert told(crowd, found=60, keyframes={10: 0.7}, confirmed=confirmed)[-1].crowd.moved_keyframe_stamp is None
    assert not told(crowd, found=60, keyframes={10: 0.7}, confirmed=confirmed)[-1].is_doubtful


def test_a_look_in_which_the_scene_or_much_else_moves_otherwise_takes_back_what_looks_before_confirmed() -> None:
    crowd, enough = [0.6] * 20, TUNING.confirmed_looks
    scene_moved = told(crowd, found=60, confirmed=range(1, enough + 1), scene_moves=[enough])
    assert scene_moved[-1].is_doubtful
    much_moved = told(
        crowd, found=60, confirmed=range(1, enough + 1), as_one=lambda look: 0.6 if look == enough else 0.2
    )
    assert much_moved[-1].is_doubtful


def test_what_the_scene_confirmed_does_not_say_how_far_the_camera_has_gone_astray() -> None:
    assert not told([0.6] * 20, found=60, confirmed=range(20))[-1].witnesses.is_rooted


def test_landmarks_that_nobody_could_find_do_not_contradict_a_pose():
    tracked, landmarks = tracked_by(found=0, missed=80)
    assert Agreement.of(tracked, landmarks, 1).contradicts()
    nothing, everything = np.zeros(80, dtype=np.bool_), np.ones(80, dtype=np.bool_)
    for sight in (LineOfSight(everything, nothing, nothing), LineOfSight(nothing, nothing, everything)):
        tracked.sight = sight
        assert not Agreement.of(tracked, landmarks, 1).contradicts()


def test_two_looks_in_which_the_scene_moves_away_are_believed_whatever_else_proven_landmarks_say() -> None:
    """They may lie on a body that rested long enough to count as the scene: a door that opens before a tripod."""
    once = next_look(told(STILL)[-1], 60, 40, as_one=0.6, scene_moves=True)
    assert not once.rivals.is_left_behind
    assert next_look(once, 60, 40, as_one=0.6, scene_moves=True).rivals.is_left_behind


def test_landmarks_that_have_departed_tell_nothing() -> None:
    tracked, landmarks = tracked_by(found=80, missed=60)
    assert Agreement.of(tracked, landmarks, 1) == Agreement(80, 60)
    landmarks.departed[:50] = True
    assert Agreement.of(tracked, landmarks, 1) == Agreement(30, 10)


def test_landmarks_that_deny_a_pose_do_not_lie_on_the_body_that_it_follows() -> None:
    witnesses = Witnesses(proven_identity=10, known_identity=50)
    assert witnesses.unproven_identity == 10
    denied = witnesses.with_testimony(Agreement(found=0, missed=100), is_after_doubt=True)
    assert denied.is_denied
    assert denied.unproven_identity == 50
    assert Witnesses(known_identity=50, fresh_identity=80, denying_looks=9).unproven_identity == 80
