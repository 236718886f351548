"""When messages that are played in real time are due."""

import pytest

from odom.frame import Stamp
from sensors.pace import Pace

PERIOD_NS = 33_333_333
BEGIN = 1_700_000_000_000_000_000


def waits(stamps: list[int], rate: float = 1.0) -> list[float]:
    """Seconds waited before each message but the first by a clock that stands still otherwise."""
    pace, now, waited = Pace(rate), 100.0, list[float]()
    for stamp in stamps:
        due = max(now, pace.due(Stamp(stamp), now))
        waited.append(due - now)
        now = due
    return waited[1:]


@pytest.mark.parametrize("rate", [0.5, 1.0, 10.0])
def test_messages_come_as_far_apart_as_their_stamps_at_the_rate(rate: float) -> None:
    stamps = [BEGIN + i * PERIOD_NS for i in range(30)]
    assert waits(stamps, rate) == pytest.approx([PERIOD_NS / 1e9 / rate] * 29, abs=1e-6)


@pytest.mark.parametrize("set_by_s", [3600, -60])
def test_a_clock_that_was_set_is_neither_slept_through_nor_ends_the_pace(set_by_s: int) -> None:
    stamps = [BEGIN + i * PERIOD_NS + (set_by_s * 10**9 if i >= 10 else 0) for i in range(30)]
    expected = [PERIOD_NS / 1e9] * 29
    expected[9] = 0.0
    assert waits(stamps) == pytest.approx(expected, abs=1e-6)


def test_a_pause_of_some_seconds_is_waited_for() -> None:
    assert waits([BEGIN, BEGIN + 4 * 10**9]) == pytest.approx([4.0])
