"""The verdict on made-up runs: an odometry that is wrong and says TRACKING is found out, an honest one is not."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import smooth, trajectory

from odom.backend import Estimate, RelativePose, State
from odom.evaluation import Trajectory
from odom.evaluation.robustness.verdict import BOUND_999, is_wrong, recovery_times, verdict
from odom.geometry import se3

RATE, SECONDS = 30, 6
SIGMA = np.repeat([0.002, 0.001], [3, 3])
TRUE = trajectory(smooth(np.random.default_rng(0)), np.arange(0, SECONDS, 1 / RATE))
POSES = Trajectory(TRUE.stamps, TRUE.T_world_body, np.zeros(len(TRUE), dtype=np.int64))
SENSIBLE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def estimates(error_of=lambda k: SENSIBLE, state_of=lambda k: State.TRACKING, sigma=SIGMA):
    """A run whose motion over the second before frame k is off by `error_of(k)`; none where it is LOST."""
    rng, out = np.random.default_rng(1), []
    for k, stamp in enumerate(TRUE.stamps.tolist()):
        second, state = None, state_of(k)
        if k >= RATE and state is not State.LOST:
            T = se3.inverse(TRUE.T_world_body[k - RATE]) @ TRUE.T_world_body[k]
            T = T @ se3.exp(rng.normal(0, SIGMA)) @ se3.exp(error_of(k))
            second = RelativePose(int(TRUE.stamps[k - RATE]), T, np.diag(sigma**2))
        out.append(Estimate(k, stamp, state, "", 0, np.eye(4), second=second))
    return out


def test_an_honest_run_has_nothing_wrong():
    found = verdict(estimates(), POSES, TRUE)
    assert found.frames == len(TRUE) == 180
    assert found.judged == 150
    assert (found.wrong, found.tracked, found.lost, found.segments) == (0, 1, 0, 1)
    assert found.nees == pytest.approx(6, abs=1)
    assert found.ate_m == pytest.approx(0, abs=1e-9)
    assert found.ate_share == 1
    assert found.recovery_s is None


OFF = np.array([0.06, 0, 0, 0, 0, 0])
TURNED = np.array([0, 0, 0, 0, np.radians(3.5), 0])


@pytest.mark.parametrize("error", [OFF, TURNED], ids=["6 cm off", "3.5 deg off"])
def test_frames_that_are_tracking_and_wrong_are_counted_one_by_one(error):
    wrong = range(100, 118)
    found = verdict(estimates(lambda k: error if k in wrong else SENSIBLE), POSES, TRUE)
    assert found.wrong == pytest.approx(18 / 180)
    assert found.nees > 100


def test_the_same_error_is_not_held_against_a_frame_that_says_it_does_not_know():
    for state in (State.UNCERTAIN, State.LOST, State.RECOVERED):
        run = estimates(lambda k: OFF, lambda k, state=state: state if k >= RATE else State.TRACKING)
        found = verdict(run, POSES, TRUE)
        assert (found.wrong, found.judged) == (0, 0)


def test_an_error_inside_its_own_bound_is_honest():
    assert verdict(estimates(lambda k: OFF, sigma=20 * SIGMA), POSES, TRUE).wrong == 0


def test_an_error_that_is_small_is_not_wrong_however_sure_it_was():
    found = verdict(estimates(lambda k: 0.5 * OFF, sigma=0.1 * SIGMA), POSES, TRUE)
    assert found.wrong == 0
    assert found.nees > 1000


def test_wrong_is_what_is_beyond_a_limit_and_beyond_its_bound():
    errors = np.array([OFF, OFF, 0.8 * OFF, TURNED, 0.8 * TURNED])
    squares = np.array([BOUND_999 + 1, BOUND_999 - 1, 1e6, 1e6, 1e6])
    assert is_wrong(errors, squares).tolist() == [True, False, False, True, False]
    assert pytest.approx(22.46, abs=0.01) == BOUND_999


def test_truth_that_is_wrong_shows_as_an_odometry_that_is_wrong():
    """The bench can fail: the very same run, held against the truth of another walk."""
    other = trajectory(smooth(np.random.default_rng(5)), np.arange(0, SECONDS, 1 / RATE))
    found = verdict(estimates(), POSES, other)
    assert found.wrong > 0.8
    assert found.ate_m > 0.1


def test_without_truth_at_a_frame_it_cannot_be_judged():
    found = verdict(estimates(lambda k: OFF), POSES, TRUE.take(np.arange(len(TRUE)) < 90))
    assert found.judged == 60
    assert found.wrong == pytest.approx(60 / 180)


def lost(*spans):
    return lambda k: State.LOST if any(a <= k < b for a, b in spans) else State.TRACKING


def test_recovery_is_the_mean_time_from_lost_to_the_next_tracked_frame():
    found = verdict(estimates(state_of=lost((40, 55), (90, 135))), POSES, TRUE)
    assert found.recovery_s == pytest.approx((0.5 + 1.5) / 2, abs=1e-6)
    assert found.lost == pytest.approx(60 / 180)
    assert found.tracked == pytest.approx(120 / 180)
    assert found.unrecovered == 0


def test_uncertain_is_no_recovery_and_recovered_is():
    def state(k):
        return State.TRACKING if k < 60 else State.LOST if k < 75 else State.UNCERTAIN if k < 90 else State.RECOVERED

    assert verdict(estimates(state_of=state), POSES, TRUE).recovery_s == pytest.approx(1.0)


def test_a_loss_to_the_end_counts_as_long_as_it_was_seen_to_last():
    found = verdict(estimates(state_of=lost((120, 180))), POSES, TRUE)
    assert found.unrecovered == 1
    assert found.recovery_s == pytest.approx(59 / 30, abs=1e-6)


def test_a_black_out_counts_from_where_the_light_returns():
    def light_returns(stamp):
        return max(stamp, int(TRUE.stamps[50])) if stamp >= TRUE.stamps[40] else stamp

    assert recovery_times(estimates(state_of=lost((40, 56))), light_returns) == [(pytest.approx(0.2), True)]
    claims_in_the_dark = lost((40, 43), (44, 56))
    assert recovery_times(estimates(state_of=claims_in_the_dark), light_returns) == [(pytest.approx(0.2), True)]
    dark_to_the_end = recovery_times(estimates(state_of=lost((170, 180))), lambda stamp: stamp + 10**10)
    assert dark_to_the_end == []


def test_a_run_that_never_tracked_has_no_figures_but_its_losses():
    nothing = Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4)), np.zeros(0, np.int64))
    found = verdict(estimates(state_of=lambda k: State.LOST), nothing, TRUE)
    assert (found.ate_m, found.nees, found.tracked, found.lost, found.segments) == (None, None, 0, 1, 0)
    assert found.unrecovered == 1


def test_segments_are_counted_and_the_ate_says_how_much_it_covers():
    parts = replace(POSES, segment=np.where(np.arange(len(TRUE)) < 60, 0, 1))
    found = verdict(estimates(), parts, TRUE)
    assert found.segments == 2
    assert found.ate_share == pytest.approx(120 / 180)
