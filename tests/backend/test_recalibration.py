"""When a calibrator looks, and when what it found is taken over: by frames, never by the clock."""

import numpy as np
import pytest

from odom.backend.odometry.recalibration import Recalibration
from odom.backend.odometry.tuning import TUNING
from odom.frame import Camera
from odom.frontend.camera.stamp_clock import SteadyStamp

GIVEN, FOUND = Camera(640, 480, 525.0, 525.0, 319.5, 239.5), Camera(640, 480, 540.0, 540.0, 319.5, 239.5)


class Finds:
    again = 2.0

    def looked_at(self, odometry):
        return lambda: FOUND


@pytest.mark.parametrize("times", [1, 2, 4])
def test_a_look_at_more_frames_is_given_more_of_them_until_it_is_waited_for(times):
    recalibration, stamp = Recalibration(GIVEN, Finds()), SteadyStamp(10**18)
    measured, due = times * TUNING.calibrate_least, times * TUNING.calibrate_frames
    assert recalibration.after_frame(None, measured, 100, stamp) is None
    assert recalibration.after_frame(None, measured, 100 + due - 1, stamp) is None
    assert recalibration.after_frame(None, measured, 100 + due, stamp) == FOUND


def test_a_slow_stream_takes_it_over_by_its_stamps():
    recalibration, stamp = Recalibration(GIVEN, Finds()), SteadyStamp(10**18)
    later = SteadyStamp(stamp + round(1.01e9 * TUNING.calibrate_s))
    assert recalibration.after_frame(None, TUNING.calibrate_least, 100, stamp) is None
    assert recalibration.after_frame(None, TUNING.calibrate_least, 101, later) == FOUND


def test_the_calibrator_says_after_how_many_more_frames_it_wants_to_look_again():
    class FindsNothing:
        again, looks = 2.0, 0

        def looked_at(self, odometry):
            self.looks += 1
            return lambda: None

    calibrator, stamp = FindsNothing(), SteadyStamp(10**18)
    recalibration, at, frame = Recalibration(GIVEN, calibrator), [], 0
    for measured in range(1, TUNING.calibrate_most):
        calibrator.again = 2.0 if measured < 3 * TUNING.calibrate_least else 1.25
        before, frame = calibrator.looks, frame + 10 * TUNING.calibrate_frames
        recalibration.after_frame(None, measured, frame, stamp)
        recalibration.after_frame(None, measured, frame + 9 * TUNING.calibrate_frames, stamp)
        at += [measured] * (calibrator.looks - before)
    assert at[:2] == [TUNING.calibrate_least, 2 * TUNING.calibrate_least]
    assert at[2] == 3 * TUNING.calibrate_least
    assert at[3] == int(np.ceil(1.25 * at[2]))
