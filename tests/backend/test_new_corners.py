"""New corners of a key frame become landmarks at a fixed frame soon after it, however long it takes to find them."""

import time
from dataclasses import replace

import numpy as np
import pytest
from painted_room import SMALL
from running import numbers, run

from odom.backend import Odometry
from odom.backend.mapping import new_corners
from odom.frame import Stamp


def own_landmarks_after(frames):
    """How many landmarks of its own the last key frame has: after it, after the next frame, and so on."""
    odometry, counts = Odometry(SMALL), []
    for frame in frames:
        if odometry.process(frame).is_keyframe:
            counts = []
        L = odometry.map.landmarks
        counts.append(np.count_nonzero(L.alive & (L.keyframe == len(odometry.map.keyframes) - 1)))
    assert len(odometry.map.keyframes) > 1
    return counts


def at_rate(frames, rate_hz):
    """The same frames, as if so many had come in a second."""
    stamps = [Stamp(10**9 + round(k * 1e9 / rate_hz)) for k in range(len(frames))]
    return [replace(f, stamp=stamp, depth_stamp=stamp) for f, stamp in zip(frames, stamps, strict=True)]


def test_those_of_a_quick_stream_are_landmarks_after_one_more_frame(room_frames):
    counts = own_landmarks_after(at_rate(room_frames, 60.0))
    assert counts[0] == 0
    assert counts[1] > 10


@pytest.mark.parametrize("rate_hz", [15.0, 30.0])
def test_those_of_others_are_landmarks_for_the_next_frame(room_frames, rate_hz):
    assert own_landmarks_after(at_rate(room_frames, rate_hz))[0] > 10


def test_results_do_not_depend_on_how_long_it_takes(room_frames, monkeypatch):
    room_frames = at_rate(room_frames, 60.0)
    at_once = numbers(run(SMALL, room_frames))
    detect = new_corners.detect_corners

    def slowly(*arguments):
        time.sleep(0.1)
        return detect(*arguments)

    monkeypatch.setattr(new_corners, "detect_corners", slowly)
    assert numbers(run(SMALL, room_frames)) == at_once
