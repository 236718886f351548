"""A walk of 300 m through the simulated building: what it was sure of before it came back, and what closing changes."""

from pathlib import Path

import pytest
from building import walked

from sensors.arena import ArenaOptions

pytestmark = pytest.mark.slow


@pytest.mark.timeout(7200)
def test_three_hundred_metres_are_closed_where_they_began(tmp_path: Path) -> None:
    how = walked(ArenaOptions(rooms=92, every=2), tmp_path / "building.map")
    print(how)
    assert how.walked_m > 300
    assert how.tracked > 0.99
    assert how.closed_after_m is not None
    assert how.ate_m <= 0.05
    assert how.nees_before <= 9
    assert how.cpu_ms_p99[-1] <= 1.1 * how.cpu_ms_p99[0]
    assert max(how.rss_mb) <= 1.1 * how.rss_mb_at_100_m
