"""What arrives for the odometry, and how much of it may wait.

Few frames wait here: of a recorded source whoever puts them waits for room, and with it, unacknowledged, the sender; of
a live one the oldest waiting frame makes room for the newest, but for its first second: while the lens' table is made
frames pile up, and the very first, of which no motion is known yet, are the worst to miss.
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
_STARTING_S, _STARTING_ROOM = 1.0, 30
MOST_TRUTH = 4096


@dataclass(frozen=True, eq=False)
class FrameArrival:
    """A decoded frame; `origin` is when it came to be, None where no latency can be told.

    That is the capture stamp of a live sensor, and the time of sending of a recording played in real time. The frame is
    grey, `color` is the message of its image.
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


class WaitingRoom:
    """Arrivals in order, from one thread to another; `overtaken` counts live frames that made room for newer ones."""

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
        """Whether nothing more is to be put in."""
        return self._closed

    def close(self) -> None:
        """Let nobody wait for room any more; what waits can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def fail(self, error: BaseException) -> None:
        """Hand over what has ended the thread that puts, behind its last arrival."""
        with self._changed:
            self._failure = error
            self._changed.notify_all()

    def put(self, arrival: CameraArrival | TruthArrival | EndArrival) -> bool:
        """Add what is no frame; False, and it is left out, where thousands of true poses wait already."""
        with self._changed:
            if len(self._waiting) >= MOST_TRUTH and isinstance(arrival, TruthArrival):
                return False
            self._waiting.append(arrival)
            self._changed.notify_all()
            return True

    def put_color(self, arrival: ColorArrival) -> None:
        """Add a live colour image, in place of one that waits still."""
        with self._changed:
            self._drop_oldest(ColorArrival)
            self._waiting.append(arrival)
            self._changed.notify_all()

    def put_frame(self, arrival: FrameArrival, live: bool) -> None:
        """Add a frame: of a `live` source at once, of a recorded one when there is room."""
        with self._changed:
            if live:
                self._drop_oldest(ColorArrival)  # not looked at yet: it is in the frame that comes, or old
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

        Raises what has ended the thread that puts, behind the last arrival.
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
        """Yield what still waits, after `close`."""
        while self._waiting:
            arrival = self.take(0.0)
            assert arrival is not None
            yield arrival

    def _room(self, now: float) -> int:
        """Return how many live frames may wait; the first time asked is when the sensor has started."""
        if self._started_at is None:
            self._started_at = now
        return self._live_room if now - self._started_at > _STARTING_S else max(self._live_room, _STARTING_ROOM)

    def _drop_oldest(self, kind: type[Arrival]) -> bool:
        """Take out the oldest waiting arrival of a kind; say whether there was one."""
        oldest = next((i for i, arrival in enumerate(self._waiting) if isinstance(arrival, kind)), None)
        if oldest is not None:
            del self._waiting[oldest]
        return oldest is not None
