"""The whole odometry on real Kinect recordings; short ones here, whole ones in the acceptance tests."""

from dataclasses import replace

import numpy as np
import pytest
from running import check_sanity, run

from odom.backend import State

TIMING_MS = (25.0, -30.0, 30.0)
"""The readout, lag of depth and readout of depth of TUM's camera, by `fr1_xyz` and its reverse in time."""
TIMING_OFF_MS = (2.0, 4.0, 8.0)
"""By how much less than this what is found in some seconds may be off."""


def test_a_desk_is_tracked_and_the_rolling_shutter_is_found(desk, desk_ran):
    _, frames, truth = desk
    check_sanity(desk_ran)
    assert set(desk_ran.states) == {State.TRACKING}
    report = desk_ran.judged(truth)
    assert report.matched == len(frames)
    assert report.ate_m < 0.0125  # .0098 measured; motion capture itself is good for about .005
    assert report.rpe_1s.rmse_m < 0.022


def test_fast_turns_are_tracked_and_the_rolling_shutter_is_found(turning):
    camera, frames, truth = turning
    ran = run(camera, frames)
    check_sanity(ran)
    report = ran.judged(truth)
    assert report.matched >= 0.99 * len(frames)
    assert State.LOST not in ran.states
    assert report.ate_m <= 0.018
    assert report.rpe_frame.rmse_deg <= 0.44
    assert 0.010 < ran.timing.readout_s < 0.030
    np.testing.assert_array_less(np.abs(1e3 * ran.timing.vector - TIMING_MS), TIMING_OFF_MS)


def test_rows_that_are_read_upwards_are_as_good_where_it_is_said(desk_ran, hanging_desk, hanging_desk_ran):
    _, _, truth = hanging_desk
    assert hanging_desk_ran.judged(truth).ate_m < 1.15 * desk_ran.judged(truth).ate_m
    np.testing.assert_array_less(np.abs(1e3 * desk_ran.timing.vector - TIMING_MS), TIMING_OFF_MS)
    downwards, upwards = (1e3 * ran.timing.vector for ran in (desk_ran, hanging_desk_ran))
    upwards = upwards * (-1.0, 1.0, -1.0)
    np.testing.assert_array_less(np.abs(upwards - TIMING_MS), TIMING_OFF_MS)
    np.testing.assert_array_less(np.abs(upwards - downwards), (2.0, 2.0, 4.0))


@pytest.mark.parametrize("pattern", ["one of twenty", "every fourth both ways"])
def test_depth_of_few_pixels_is_as_good_as_all_of_it(desk, desk_ran, pattern):
    camera, frames, truth = desk
    measured = np.random.default_rng(1).random(frames[0].depth_mm.shape) < 0.05
    if pattern != "one of twenty":
        measured[:] = False
        measured[3::4, 3::4] = True
    ran = run(camera, [replace(f, depth_mm=f.depth_mm * measured) for f in frames[:100]])
    check_sanity(ran)
    assert set(ran.states) == {State.TRACKING}
    whole = [e.T_odom_camera for e in desk_ran.estimates[:100]]
    apart = [
        np.linalg.norm((np.linalg.inv(a) @ e.T_odom_camera)[:3, 3]) for a, e in zip(whole, ran.estimates, strict=True)
    ]
    assert max(apart) < 0.02
    assert ran.judged(truth).ate_m < 0.0125  # as of the whole depth


def test_a_place_is_known_again_while_the_camera_turns_fast(turning):
    camera, frames, _ = turning
    dark = range(188, 196)
    seen = frames[:205]
    for k in dark:  # the lens is covered
        seen[k] = replace(seen[k], color=np.zeros_like(seen[k].color), depth_mm=np.zeros_like(seen[k].depth_mm))
    ran = run(camera, seen)
    check_sanity(ran)
    assert ran.states[dark.stop - 1] is State.LOST
    assert State.RECOVERED in ran.states[dark.stop : dark.stop + 2]
    assert set(ran.states[dark.stop + 2 :]) == {State.TRACKING}
    assert {e.segment for e in ran.estimates} == {0}
