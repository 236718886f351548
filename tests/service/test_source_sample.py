"""A stretch of a source, as `odom doctor` and `odom mask` look at it."""

import threading
import time
from collections.abc import Iterator

import numpy as np

from odom.frame import Stamp
from odom.service.source_sample import look_at
from odom.wire import Message, Topics
from odom.wire.codec import encode_color


class SilentCamera:
    """A live source that gives one image and then waits for the next."""

    lossless = False
    length: int | None = None

    def __init__(self) -> None:
        self.closed = threading.Event()

    def messages(self) -> Iterator[Message]:
        yield encode_color(Topics().color, Stamp(10**18), np.zeros((48, 64, 3), np.uint8))
        self.closed.wait(20)

    def close(self) -> None:
        self.closed.set()


def test_a_look_at_a_source_that_has_fallen_silent_is_stopped_and_keeps_what_was_seen() -> None:
    stop, source, begun = threading.Event(), SilentCamera(), time.monotonic()
    threading.Timer(0.3, stop.set).start()
    recording = look_at(source, Topics(), 10.0, stop.is_set)
    assert time.monotonic() - begun < 10
    assert len(recording.color_stamps) == 1
