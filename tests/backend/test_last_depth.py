"""How long the camera has been without depth, by stamps that may step back."""

import numpy as np
import pytest

from odom.backend.odometry.last_depth import LastDepth
from odom.frontend.camera.stamp_clock import SteadyStamp


@pytest.mark.parametrize("set_back_s", [0, 60], ids=["as usual", "clock set back"])
def test_depth_that_stops_is_noticed_within_a_second(set_back_s):
    known = LastDepth().after_depth(SteadyStamp(10**11)).after_tracked(SteadyStamp(10**11), np.ones(50))
    now = SteadyStamp(10**11 + round((1.0 - set_back_s) * 1e9))
    without = known.after_tracked(now, np.zeros(50))
    assert without.is_shallow(now)
    assert without.is_blind(now, 0.12, 1.0 / 30.0)


def test_depth_that_goes_on_after_the_clock_was_set_back_is_seen():
    known = LastDepth().after_depth(SteadyStamp(10**11)).after_tracked(SteadyStamp(10**11), np.ones(50))
    now = SteadyStamp(4 * 10**10)
    again = known.after_depth(now).after_tracked(now, np.ones(50))
    assert not again.is_shallow(now)
    assert not again.is_blind(now, 0.12, 1.0 / 30.0)


def test_a_stream_without_depth_is_blind_from_its_first_frame_on_also_where_stamps_begin_at_zero():
    assert LastDepth().is_blind(SteadyStamp(0), 0.12, 1.0 / 30.0)
