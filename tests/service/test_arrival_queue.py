"""What waits for the odometry of a sensor that is faster than it."""

import threading

import numpy as np
import pytest

from odom.frame import RgbdFrame, Stamp
from odom.service.arrival_queue import ArrivalQueue, ColorArrival, EndArrival, FrameArrival

GREY, DEPTH = np.zeros((4, 4), dtype=np.uint8), np.zeros((4, 4), dtype=np.uint16)


def frame(number: int) -> FrameArrival:
    stamp = Stamp(number * 33_333_333)
    return FrameArrival(RgbdFrame(number, stamp, GREY, stamp, DEPTH), None)


def frames_of(room: ArrivalQueue) -> list[int]:
    return [arrival.frame.sequence for arrival in room.drain() if isinstance(arrival, FrameArrival)]


def test_a_live_sensors_first_second_is_kept_and_then_the_newest_frames_win() -> None:
    now = 5.0
    room = ArrivalQueue(3, lambda: now)
    for number in range(20):
        room.put_frame(frame(number), live=True)
    assert room.overtaken == 0
    now = 6.1
    for number in range(20, 25):
        room.put_frame(frame(number), live=True)
    room.close()
    assert frames_of(room) == [22, 23, 24]
    assert room.overtaken == 22


def test_a_slow_start_is_bounded_too() -> None:
    room = ArrivalQueue(3, lambda: 0.0)
    for number in range(100):
        room.put_frame(frame(number), live=True)
    assert frames_of(room) == list(range(70, 100))


def test_a_recorded_source_waits_for_room_and_loses_nothing() -> None:
    room = ArrivalQueue(3)

    def put() -> None:
        for number in range(50):
            room.put_frame(frame(number), live=False)
        room.put(EndArrival("done"))

    putting = threading.Thread(target=put, daemon=True)
    putting.start()
    taken = []
    while not isinstance(arrival := room.take(5.0), EndArrival):
        assert isinstance(arrival, FrameArrival)
        taken.append(arrival.frame.sequence)
    assert taken == list(range(50))
    assert room.overtaken == 0


def test_of_live_colour_images_the_newest_waits_and_none_behind_its_frame() -> None:
    room = ArrivalQueue(3)
    for number in range(3):
        room.put_color(ColorArrival(Stamp(number), GREY))
    first = room.take(0.0)
    assert isinstance(first, ColorArrival)
    assert first.stamp == 2
    room.put_color(ColorArrival(Stamp(3), GREY))
    room.put_frame(frame(3), live=True)
    assert isinstance(room.take(0.0), FrameArrival)
    assert room.take(0.0) is None


def test_what_ended_the_putting_thread_is_raised_behind_its_last_arrival() -> None:
    room = ArrivalQueue(3)
    room.put_frame(frame(0), live=False)
    room.fail(ValueError("broken"))
    assert isinstance(room.take(0.0), FrameArrival)
    with pytest.raises(ValueError, match="broken"):
        room.take(0.0)
