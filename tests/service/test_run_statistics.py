"""Measures of a run: right to one percent, in bounded memory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from odom.service.run_statistics import Durations, RunStatistics


@given(st.lists(st.floats(0.02, 1e5), min_size=1, max_size=300), st.sampled_from([0.5, 0.95, 0.99]))
def test_quantiles_are_right_to_one_percent(values: list[float], share: float) -> None:
    durations = Durations()
    for value in values:
        durations.add(value)
    expected = np.quantile(values, share, method="inverted_cdf")
    assert durations.quantile(share) == pytest.approx(expected, rel=0.011)
    assert durations.mean == pytest.approx(np.mean(values))


def test_what_was_not_measured_is_none() -> None:
    report = RunStatistics().report()
    assert report["latency_ms"] == {"p50": None, "p95": None, "p99": None}
    assert report["fps"] is None
    assert report["completeness"] is None


@pytest.mark.parametrize("value", [0.0, 1e-9, 1e9])
def test_durations_beyond_the_range_are_counted(value: float) -> None:
    durations = Durations()
    durations.add(value)
    assert len(durations) == 1
