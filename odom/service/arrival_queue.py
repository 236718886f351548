"""The queue between the thread that receives and the odometry: what arrives, and how much of it may wait.

A recorded source waits: while the queue is full, `put_frame` blocks, nothing is acknowledged and the sender pauses. Of
a live source the oldest waiting frame is dropped for the newest. Only in its first second may more frames wait: the
table of the lens is computed then, and the first frames, before any motion is known, are the worst to lose.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera, RgbdFrame, Stamp
from odom.wire import Message, codec

_LOSSLESS_ROOM = 2
"""Recorded frames that wait: one being processed and one decoded keep both threads busy; more only take memory."""
_STARTING_S, _STARTING_ROOM = 1.0, 30
"""Seconds of a live source, and the frames that may wait in them: one second at 30 Hz, so that none of the first is
lost while the table of the lens is computed; longer, and a slow computer would show the past."""
MOST_TRUTH = 4096
"""True poses that wait: 17 s of motion capture at 240 Hz. Fewer lose truth while the odometry computes, more take
memory (0.5 kB each) when it has stopped."""


@dataclass(frozen=True, eq=False)
class FrameArrival:
    """A decoded frame; `origin` is the time from which its latency counts, None where there is none to measure.

    For a live sensor that is the capture stamp, for a recording played in real time the time of sending. The frame is
    grey, `color` is the message of its colour image.
    """

    frame: RgbdFrame
    origin: Stamp | None
    color: Message | None = None


@dataclass(frozen=True)
class CameraArrival:
    """The calibration of the frames that follow, before the first of them."""

    camera: Camera


@dataclass(frozen=True, eq=False)
class ColorArrival:
    """A live sensor's colour image, while its depth is on its way."""

    stamp: Stamp
    color: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class TruthArrival:
    """A pose of a motion capture body."""

    body: str
    pose: codec.StampedPose


@dataclass(frozen=True)
class EndArrival:
    """The source has ended."""

    reason: str


Arrival = CameraArrival | FrameArrival | ColorArrival | TruthArrival | EndArrival


class ArrivalQueue:
    """Arrivals in order, from one thread to another; `overtaken` counts live frames dropped for newer ones."""

    def __init__(self, live_room: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.overtaken = 0
        self._live_room = live_room
        self._clock = clock
        self._waiting: deque[Arrival] = deque()
        self._frames = 0
        self._started_at: float | None = None
        self._changed = threading.Condition()
        self._closed = False
        self._failure: BaseException | None = None

    @property
    def is_closed(self) -> bool:
        """Whether `close` was called."""
        return self._closed

    def close(self) -> None:
        """End all waiting for room; what is in the queue can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def fail(self, error: BaseException) -> None:
        """Let `take` raise `error`, which ended the receiving thread, after the last arrival."""
        with self._changed:
            self._failure = error
            self._changed.notify_all()

    def put(self, arrival: CameraArrival | TruthArrival | EndArrival) -> bool:
        """Add anything but a frame; return False for a true pose that is dropped because thousands wait already."""
        with self._changed:
            if len(self._waiting) >= MOST_TRUTH and isinstance(arrival, TruthArrival):
                return False
            self._waiting.append(arrival)
            self._changed.notify_all()
            return True

    def put_color(self, arrival: ColorArrival) -> None:
        """Add a live colour image in place of one that still waits."""
        with self._changed:
            self._drop_oldest(ColorArrival)
            self._waiting.append(arrival)
            self._changed.notify_all()

    def put_frame(self, arrival: FrameArrival, live: bool) -> None:
        """Add a frame of a `live` source at once, one of a recorded source as soon as there is room."""
        with self._changed:
            if live:
                self._drop_oldest(ColorArrival)  # it is of this frame or of an older one
                room = self._room(self._clock())
                while self._frames >= room and self._drop_oldest(FrameArrival):
                    self._frames -= 1
                    self.overtaken += 1
            else:
                while self._frames >= _LOSSLESS_ROOM and not self._closed:
                    self._changed.wait()
            self._waiting.append(arrival)
            self._frames += 1
            self._changed.notify_all()

    def take(self, timeout: float) -> Arrival | None:
        """Return the next arrival in order, None when none came within `timeout` seconds.

        After the last arrival it raises what ended the receiving thread.
        """
        with self._changed:
            if not self._waiting and self._failure is None:
                self._changed.wait(timeout)
            if not self._waiting:
                if self._failure is not None:
                    raise self._failure
                return None
            arrival = self._waiting.popleft()
            if isinstance(arrival, FrameArrival):
                self._frames -= 1
                self._changed.notify_all()
            return arrival

    def drain(self) -> Iterator[Arrival]:
        """Yield what is left after `close`."""
        while self._waiting:
            arrival = self.take(0.0)
            assert arrival is not None
            yield arrival

    def _room(self, now: float) -> int:
        """Return how many live frames may wait `now`; the first call is the start of the source."""
        if self._started_at is None:
            self._started_at = now
        return self._live_room if now - self._started_at > _STARTING_S else max(self._live_room, _STARTING_ROOM)

    def _drop_oldest(self, kind: type[Arrival]) -> bool:
        """Remove the oldest waiting arrival of a kind; return whether there was one."""
        oldest = next((i for i, arrival in enumerate(self._waiting) if isinstance(arrival, kind)), None)
        if oldest is not None:
            del self._waiting[oldest]
        return oldest is not None
