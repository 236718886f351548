"""New corners of a key frame become landmarks at a fixed frame soon after it, however long it takes to find them."""

import time
from dataclasses import replace

import numpy as np
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


def slowed(frames, times):
    """The same frames, as if they had come so many times as slowly."""
    stamps = [Stamp(times * frame.stamp) for frame in frames]
    return [replace(f, stamp=stamp, depth_stamp=stamp) for f, stamp in zip(frames, stamps, strict=True)]


def test_they_are_landmarks_after_one_more_frame(room_frames):
    counts = own_landmarks_after(room_frames)
    assert counts[0] == 0
    assert counts[1] > 10


def test_those_of_a_slow_stream_are_landmarks_for_the_next_frame(room_frames):
    assert own_landmarks_after(slowed(room_frames, 2))[0] > 10


def test_results_do_not_depend_on_how_long_it_takes(room_frames, monkeypatch):
    at_once = numbers(run(SMALL, room_frames))
    detect = new_corners.detect_corners

    def slowly(*arguments):
        time.sleep(0.1)
        return detect(*arguments)

    monkeypatch.setattr(new_corners, "detect_corners", slowly)
    assert numbers(run(SMALL, room_frames)) == at_once
