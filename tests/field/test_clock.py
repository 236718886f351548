"""The mapping of a device's clock to the host's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sensors.host_time import ClockMapping, Unwrap, tick_length

START = 1_700_000_000_000_000_000


def play(
    mapping: ClockMapping, seconds: float, drift: float, delay_ms: np.random.Generator, shift_ns: int = 0
) -> np.ndarray:
    """Feed 30 pairs a second; return the error of each mapped stamp in ms."""
    errors = []
    for index in range(int(seconds * 30)):
        true_ns = START + index * 33_333_333
        device_ns = 5_000_000 + round(index * 33_333_333 / (1 + drift))
        delay_ns = round(1e6 * (2.0 + delay_ms.exponential(4.0)))
        mapping.observe(device_ns, true_ns + delay_ns + shift_ns)
        errors.append((mapping.to_host(device_ns) - true_ns - shift_ns) * 1e-6)
    return np.array(errors)


@pytest.mark.parametrize("ppm", [-120.0, 0.0, 60.0, 300.0])
def test_drift_and_jitter_vanish_but_for_the_least_delay(ppm: float) -> None:
    errors = play(ClockMapping(), 300, ppm * 1e-6, np.random.default_rng(1))
    settled = errors[30 * 60 :]
    # The least delay (2 ms) cannot be told from an offset; what varies must be far below the 4 ms of jitter.
    assert abs(np.median(settled) - 2.0) < 0.4
    assert settled.std() < 0.15
    assert np.abs(np.diff(settled)).max() < 0.3


def test_a_delay_is_no_step_but_a_clock_that_was_set_is() -> None:
    mapping = ClockMapping()
    for index in range(300):
        late = 800_000_000 if index == 200 else 0
        mapping.observe(index * 33_333_333, START + index * 33_333_333 + late)
    assert mapping.resets == 0
    for shift in (3_600_000_000_000, -3_600_000_000_000):
        mapping = ClockMapping()
        for index in range(600):
            host = START + index * 33_333_333 + (shift if index >= 300 else 0)
            mapping.observe(index * 33_333_333, host)
        assert mapping.resets == 1
        assert abs(mapping.to_host(599 * 33_333_333) - (START + 599 * 33_333_333 + shift)) < 1_000_000


def test_a_device_clock_that_begins_anew_is_followed_at_once() -> None:
    mapping = ClockMapping()
    for index in range(300):
        begun = 200 if index >= 200 else 0
        host_ns, device_ns = START + index * 33_333_333, (index - begun) * 33_333_333
        mapping.observe(device_ns, host_ns)
        assert abs(mapping.to_host(device_ns) - host_ns) < 1000
    assert mapping.resets == 1


def test_memory_is_bounded() -> None:
    mapping = ClockMapping()
    for second in range(1000):
        mapping.observe(second * 10**9, START + second * 10**9)
    assert len(mapping._best) == 120


@pytest.mark.parametrize("unit", [1e3, 1e3 / 60, 125e3, 100e3])
def test_the_unit_of_the_stamps_is_recognised_in_spite_of_jitter(unit: float) -> None:
    for jitter_ns in (-20_000_000, 0, 20_000_000):
        assert tick_length(round(300e6 / unit), 300_000_000 + jitter_ns) == unit
    assert tick_length(0, 300_000_000) is None
    assert tick_length(7, 300_000_000) is None


@given(st.integers(8, 40), st.lists(st.integers(1, 100), max_size=300), st.integers(0, 1 << 40))
def test_unwrapping_gives_back_what_was_wrapped(bits: int, steps: list[int], first: int) -> None:
    unwrap = Unwrap(bits)
    true = np.cumsum([first % (1 << bits), *steps]).tolist()
    assert [unwrap(value % (1 << bits)) for value in true] == true
