from itertools import pairwise

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


def times_of(period_s, until_s=20.0):
    """Return the times (s) of frames whose period at any time is `period_s` of it."""
    times = [0.0]
    while times[-1] < until_s:
        times.append(times[-1] + period_s(times[-1]))
    return np.array(times)


def swinging(by_s):
    return lambda t: 1 / 30 + by_s * np.sin(2.1 * t)


def slowing(to_s, within_s):
    return lambda t: 1 / 30 + (to_s - 1 / 30) * np.clip((t - 5.0) / within_s, 0.0, 1.0)


CHANGING_RATES = {
    "33 to 50 ms in 1 s": slowing(0.05, 1.0),
    "33 to 67 ms in 2 s": slowing(1 / 15, 2.0),
    "33 to 40 ms in .5 s": slowing(0.04, 0.5),
    "33 +- 3 ms": swinging(0.003),
    "33 +- 10 ms": swinging(0.01),
}
with_changing_rates = pytest.mark.parametrize("period_s", CHANGING_RATES.values(), ids=CHANGING_RATES)


@with_changing_rates
def test_exact_stamps_stay_as_they_are_where_exposure_changes_the_rate(period_s):
    clocks = list(clocks_of(stamps_of(times_of(period_s))))[30:]
    assert np.abs([clock.late_s for clock in clocks]).max() < 0.002
    assert max(clock.sigma_s for clock in clocks) < 0.001


@with_changing_rates
def test_how_unsure_steady_times_are_is_known_where_stamps_jitter_and_the_rate_changes(period_s):
    true_s = times_of(period_s)
    jitter_s = 0.0005 * np.random.default_rng(7).normal(size=len(true_s))
    clocks = list(clocks_of(stamps_of(true_s + jitter_s)))[30:]
    errors = np.array([clock.steady - START_NS for clock in clocks]) * 1e-9 - true_s[30:]
    assert np.mean((errors / [clock.sigma_s for clock in clocks]) ** 2) < 4.0


def test_a_rate_that_drifts_with_temperature_keeps_jitter_smoothed():
    true_s = times_of(lambda t: (1.0 + 1e-5 * t) / 30.0)
    jitter_s = 0.002 * np.random.default_rng(8).normal(size=len(true_s))
    assert np.std(steady_errors_s(true_s, true_s + jitter_s)[60:]) < 0.45 * 0.002


@pytest.mark.parametrize("count", [2, 3])
def test_a_few_late_stamps_in_a_row_are_no_change_of_rate(count):
    true_s = np.arange(400) / 30.0
    stamped_s = true_s + 1e-5 * np.random.default_rng(9).normal(size=400)
    stamped_s[150 : 150 + count] += 0.015
    assert np.abs(steady_errors_s(true_s, stamped_s)).max() < 0.001


@pytest.mark.parametrize("every_third_is_missing", [False, True])
@pytest.mark.parametrize("jitter_s", [0.0, 0.002, 0.01])
@pytest.mark.parametrize("by_s", [0.0, 0.003, 0.01])
def test_steady_time_advances_wherever_stamps_do(by_s, jitter_s, every_third_is_missing):
    true_s = times_of(swinging(by_s))
    seconds = np.delete(true_s, np.s_[2::3]) if every_third_is_missing else true_s
    stamps = stamps_of(np.sort(seconds + jitter_s * np.random.default_rng(10).normal(size=len(seconds))))
    steady = np.array([clock.steady for clock in clocks_of(stamps)])
    assert (np.diff(steady) > 0).all()


@given(st.lists(st.integers(10**3, 10**9), max_size=60))
def test_steady_time_advances_with_any_stamps_that_do(steps):
    clocks = list(clocks_of([Stamp(START_NS + int(ns)) for ns in np.cumsum([0, *steps])]))
    assert all(before.steady < after.steady for before, after in pairwise(clocks))


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
