import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from odom.frame import Stamp
from odom.frontend.camera.stamp_clock import StampClock

START_NS = 1_700_000_000_000_000_000


def stamps_of(seconds):
    return [Stamp(START_NS + round(s * 1e9)) for s in seconds]


def clocks_of(stamps):
    clock = StampClock()
    for stamp in stamps:
        clock = clock.after(stamp)
        yield clock


def steady_errors_s(true_s, stamped_s):
    steady = np.array([c.steady - START_NS for c in clocks_of(stamps_of(stamped_s))]) * 1e-9
    errors = steady - true_s
    return errors - errors[60:].mean()


@pytest.mark.parametrize("jitter_periods", [0.05, 0.15])
@pytest.mark.parametrize("rate_hz", [10.0, 29.97, 60.0])
def test_steady_times_are_several_times_nearer_to_the_truth_than_jittering_stamps(rate_hz, jitter_periods):
    rng = np.random.default_rng(1)
    true_s = np.arange(400) / rate_hz
    stamped_s = true_s + jitter_periods / rate_hz * rng.normal(size=400)
    errors = steady_errors_s(true_s, stamped_s)
    assert np.std(errors[60:]) < 0.45 * np.std(stamped_s - true_s)


def test_missing_frames_and_a_late_stamp_do_not_move_the_others():
    rng = np.random.default_rng(2)
    true_s = np.delete(np.arange(400) / 30.0, [70, 71, 130, 200, 201, 202, 300])
    stamped_s = true_s + 0.001 * rng.normal(size=len(true_s))
    stamped_s[150] += 0.015
    errors = steady_errors_s(true_s, stamped_s)
    assert np.abs(np.delete(errors[60:], 150 - 60)).max() < 0.002


@pytest.mark.parametrize("period_s", [0.6, 1.0])
def test_the_period_of_a_slow_stream_is_learnt(period_s):
    *_, clock = clocks_of(stamps_of(period_s * np.arange(5)))
    assert clock.period_s == pytest.approx(period_s, rel=1e-6)
    *_, slowed_down = clocks_of(stamps_of(np.concatenate([np.arange(9) / 30.0, 1.0 + period_s * np.arange(5)])))
    assert slowed_down.period_s == pytest.approx(period_s, rel=1e-6)


@pytest.mark.parametrize("jitter_s", [0.0, 0.0005])
@pytest.mark.parametrize("of", [3, 4, 5])
def test_steady_times_hold_where_one_frame_of_a_few_is_missing(of, jitter_s):
    rng = np.random.default_rng(3)
    true_s = np.delete(np.arange(600), np.arange(of - 1, 600, of)) / 30.0
    errors = steady_errors_s(true_s, true_s + jitter_s * rng.normal(size=len(true_s)))
    assert np.std(errors[60:]) < 0.5 * jitter_s + 1e-6


def test_a_gap_is_not_a_period():
    *_, clock = clocks_of(stamps_of(np.concatenate([np.arange(40), 40 + 45 + np.arange(3)]) / 30.0))
    assert clock.period_s == pytest.approx(1 / 30, rel=1e-6)


def test_exact_stamps_stay_as_they_are():
    for stamp, clock in zip(stamps := stamps_of(np.arange(100) / 30.0), clocks_of(stamps), strict=True):
        assert abs(clock.steady - stamp) < 1000
    assert clock.period_s == pytest.approx(1 / 30, rel=1e-6)
    assert clock.sigma_s < 1e-6


def test_stamps_without_a_period_are_taken_for_true():
    rng = np.random.default_rng(3)
    stamps = stamps_of(np.cumsum(rng.uniform(0.01, 0.1, 200)))
    unsteadied = [clock.steady == stamp for stamp, clock in zip(stamps, clocks_of(stamps), strict=True)]
    assert np.mean(unsteadied) > 0.9


@pytest.mark.parametrize("every", [2, 3, 8])
def test_where_a_frame_is_missing_before_every_nth_is_taken_no_later_one_is_moved_by_that(every):
    rng = np.random.default_rng(5)
    all_s = np.delete(np.arange(600) / 10.0, [301, 402])[::every]
    stamped_s = all_s + 0.001 * rng.normal(size=len(all_s))
    steady_s = np.array([c.steady - START_NS for c in clocks_of(stamps_of(stamped_s))]) * 1e-9
    assert np.abs(steady_s - all_s).max() < 0.005


@pytest.mark.parametrize("jitter_s", [0.0005, 0.003])
def test_the_jitter_is_known_and_remembered_over_a_gap(jitter_s):
    rng = np.random.default_rng(4)
    seconds = np.arange(90) / 30.0 + jitter_s * rng.normal(size=90)
    *_, clock = clocks_of(stamps_of(seconds))
    assert clock.jitter_s == pytest.approx(jitter_s, rel=0.4)
    assert 0.2 * jitter_s < clock.sigma_s < jitter_s
    after_gap = clock.after(Stamp(clock.stamps[-1] + 5_000_000_000))
    assert after_gap.late_s == 0.0
    assert after_gap.sigma_s == clock.jitter_s


def test_how_unsure_steady_times_are_is_known_where_stamps_jitter_by_a_quarter_of_a_period():
    rng = np.random.default_rng(6)
    true_s = np.arange(600) / 30.0
    stamps = stamps_of(np.maximum.accumulate(true_s + 0.007 * rng.normal(size=600) + 1e-6 * np.arange(600)))
    clocks = list(clocks_of(stamps))[60:]
    errors = np.array([clock.steady - START_NS for clock in clocks]) * 1e-9 - true_s[60:]
    nees = (errors / [clock.sigma_s for clock in clocks]) ** 2
    assert nees.mean() < 3.0


@given(st.lists(st.integers(-(10**10), 10**10), max_size=60))
def test_any_stamps_give_finite_bounded_times(steps):
    stamp = START_NS
    clock = StampClock()
    for step in steps:
        stamp += step
        clock = clock.after(Stamp(stamp))
        assert abs(clock.late_s) < 0.5
        assert np.isfinite([clock.late_s, clock.sigma_s, clock.period_s, clock.jitter_s]).all()
        assert clock.sigma_s >= 0.0
        assert len(clock.stamps) <= 30
