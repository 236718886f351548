"""A walk over known ground costs no more a frame the tenth time than the second: nothing that a frame needs grows."""

import time
from dataclasses import replace

import numpy as np
import pytest
from running import read_tum_frames

from odom.backend import Odometry, State
from odom.calibration.mid_run import MidRunCalibrator
from odom.frame import Stamp

LAPS = 10
GAP_NS = 33_333_333


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_tenth_lap_costs_a_frame_what_the_second_did(shared_data):
    camera, frames, _ = read_tum_frames(shared_data / "tum_fr1_xyz", None)
    odometry = Odometry(camera, calibrator=MidRunCalibrator())
    lap_ns = frames[-1].stamp - frames[0].stamp + GAP_NS
    cpu_ms, tracked = [], []
    for lap in range(LAPS):
        states, begun = [], time.process_time()
        for k, frame in enumerate(frames):
            stamp, depth_stamp = (Stamp(s + lap * lap_ns) for s in (frame.stamp, frame.depth_stamp))
            again = replace(frame, sequence=lap * len(frames) + k, stamp=stamp, depth_stamp=depth_stamp)
            states.append(odometry.process(again).state)
        cpu_ms.append(1e3 * (time.process_time() - begun) / len(frames))
        tracked.append(np.mean([state in (State.TRACKING, State.RECOVERED) for state in states]))
    print("CPU a frame (ms) by laps", np.round(cpu_ms, 2), "key frames", len(odometry.map.keyframes))
    assert min(tracked) > 0.97
    assert np.median(cpu_ms[-3:]) <= 1.1 * np.median(cpu_ms[1:4])
