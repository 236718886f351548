"""Costs of the same frames before and now: the ratio and how sure it is."""

import numpy as np
import pytest

from odom.evaluation.paired_costs import BLOCK_FRAMES, FEWEST_BLOCKS, cost_change


def frames_ms(rng, frames=300):
    """Costs of frames, every 30th of them five times as dear."""
    costs = rng.gamma(20.0, 0.5, frames)
    costs[::30] *= 5.0
    return costs


def test_the_interval_holds_the_true_ratio_as_often_as_it_says():
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(200):
        change = cost_change("track", frames_ms(rng), 0.8 * frames_ms(rng))
        held += change.low <= 0.8 <= change.high
    assert 0.88 <= held / 200 <= 0.99


def test_what_both_runs_share_does_not_widen_the_interval():
    rng = np.random.default_rng(2)
    frames, others = frames_ms(rng), frames_ms(rng)
    paired = cost_change("track", frames, 0.9 * frames + rng.normal(0.0, 0.01, len(frames)))
    apart = cost_change("track", frames, 0.9 * others)
    assert paired.ratio == pytest.approx(0.9, abs=0.002)
    assert paired.high - paired.low < 0.1 * (apart.high - apart.low)


def test_a_stage_that_cost_nothing_before_has_no_ratio():
    frames = BLOCK_FRAMES * FEWEST_BLOCKS
    change = cost_change("relocalise", np.zeros(frames), np.ones(frames))
    assert np.isnan([change.ratio, change.low, change.high]).all()
    assert (change.before_ms, change.now_ms) == (0.0, 1.0)


@pytest.mark.parametrize(("before", "now"), [(100, 99), (BLOCK_FRAMES * FEWEST_BLOCKS - 1,) * 2])
def test_costs_of_other_or_too_few_frames_are_refused(before, now):
    with pytest.raises(ValueError, match="frames"):
        cost_change("track", np.ones(before), np.ones(now))
