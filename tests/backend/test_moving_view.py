"""When a pose is in doubt since much of the view moves, and when it is sure again."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from odom.backend.odometry.moving_view import MovingView
from odom.backend.odometry.tuning import TUNING
from odom.frontend.matching.moving_surfaces import MovingCells


@dataclass
class Shown:
    """Recent views before which a given share of the view moves; None: they cannot tell."""

    share: float | None

    def moving(self, *_: object) -> MovingCells | None:
        return None if self.share is None else MovingCells(np.zeros((2, 2), bool), self.share, (8, 8))


def told(shares: list[float | None], period_s: float = 0.1, found: int = 0, missed: int = 0) -> list[MovingView]:
    """What is known after each look, `period_s` apart; old landmarks are `found` by the pose, others `missed`."""
    landmarks = SimpleNamespace(identity=np.zeros(100, dtype=np.int64), next_identity=1)
    tracked = SimpleNamespace(
        rows=np.arange(found),
        inliers=np.ones(found, dtype=np.bool_),
        missed=np.arange(missed),
        sight=SimpleNamespace(hidden=np.zeros(missed, dtype=np.bool_)),
    )
    moving, every = MovingView(), []
    for i, share in enumerate(shares):
        view = SimpleNamespace(steady_stamp=round(1.001e9 * i * period_s))
        moving = moving.after(
            cast(Any, view), cast(Any, tracked), cast(Any, Shown(share)), cast(Any, landmarks), cast(Any, None)
        )
        every.append(moving)
    return every


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


def test_views_that_cannot_tell_end_no_doubt() -> None:
    assert told([*STILL, 0.6, *[None] * 30])[-1].doubt == "most of the view moved"
