"""How long the camera has been without depth, by stamps that may step back."""

import numpy as np
import pytest

from odom.backend.odometry.visibility import Visibility
from odom.frame import Stamp


@pytest.mark.parametrize("set_back_s", [0, 60], ids=["as usual", "clock set back"])
def test_depth_that_stops_is_noticed_within_a_second(set_back_s):
    visibility = Visibility().with_depth(Stamp(10**11)).with_tracked(Stamp(10**11), np.ones(50))
    now = Stamp(10**11 + round((1.0 - set_back_s) * 1e9))
    without = visibility.with_tracked(now, np.zeros(50))
    assert without.lacks_depth(now)
    assert without.is_blind(now, 0.12, 1.0 / 30.0)


def test_depth_that_goes_on_after_the_clock_was_set_back_is_seen():
    visibility = Visibility().with_depth(Stamp(10**11)).with_tracked(Stamp(10**11), np.ones(50))
    now = Stamp(4 * 10**10)
    again = visibility.with_depth(now).with_tracked(now, np.ones(50))
    assert not again.lacks_depth(now)
    assert not again.is_blind(now, 0.12, 1.0 / 30.0)
