"""From arriving messages to decoded frames, one thread ahead of the odometry.

Receiving and decoding frame i + 1 runs beside processing frame i (Zenoh and OpenCV release the interpreter). Few
frames wait here: of a recorded source the thread waits for room and with it, unacknowledged, the sender; of a live
one the oldest waiting frame makes room for the newest, but for its first second: while the lens' table is made frames
pile up, and the very first, of which no motion is known yet, are the worst to miss.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.frame import Camera, RgbdFrame, Stamp
from odom.wire import TRUTH, Message, Topics, codec
from odom.wire.assembler import FrameAssembler
from odom.wire.flow import Consumer
from odom.wire.session import Delivery, WireSession

_LOG = logging.getLogger(__name__)
_LOSSLESS_ROOM = 2
_LIVE_DEPTH = 3
_STARTING_S, _STARTING_ROOM = 1.0, 30
_POLL_S = 0.2
_MAX_TRUTH = 4096
_COLORS = 32
_LIVE_CLOCK_NS = 10_000_000_000


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
    """The calibration, once, before the first frame."""

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


class Intake:
    """Receives, pairs and decodes in a thread of its own, from `start` to `close`."""

    def __init__(self, session: WireSession, topics: Topics, live_room: int) -> None:
        keys = (
            topics.color,
            topics.color_compressed,
            topics.depth,
            topics.depth_compressed,
            topics.camera_info,
            TRUTH,
        )
        self.overtaken = 0
        self.uncalibrated = 0
        self.source_ended = False
        self.refused_cameras = 0
        self._color_keys = keys[:2]
        self._colors: dict[Stamp, Message] = {}
        self._consumer = Consumer(session, topics, "odometry", keys, depth=_LIVE_DEPTH)
        self.assembler = FrameAssembler(topics, grey=True, malformed=self._consumer.malformed)
        self._camera: Camera | None = None
        self._live_room = live_room
        self._started_at: float | None = None
        self._waiting: deque[Arrival] = deque()
        self._frames = 0
        self._changed = threading.Condition()
        self._closed = False
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="intake", daemon=True)

    def start(self) -> None:
        """Begin to receive."""
        self._thread.start()

    def close(self) -> None:
        """Stop receiving; what waits can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join(timeout=2.0)

    def take(self, timeout: float) -> Arrival | None:
        """Return the next arrival in order, None when none came within `timeout` seconds.

        Raises what has ended the receiving thread, behind the last arrival.
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

    @property
    def lost_frames(self) -> int:
        """Colour images that were sent, and lost on the way or overtaken by newer ones."""
        counters = [self._consumer.counters.get(key) for key in self._color_keys]
        return self.overtaken + sum(c.lost + c.dropped for c in counters if c is not None)

    @property
    def dropped(self) -> dict[str, int]:
        """Refused input by its kind, only what happened."""
        pairing = self.assembler.pairing
        counts = {f"malformed {key}": n for key, n in self._consumer.malformed.counts.copy().items()}
        counts |= {
            "duplicate stamp": pairing.duplicate,
            "backward stamp": pairing.backward,
            "stray stamp": pairing.stray,
            "stamp leap": pairing.leaps,
            "colour without depth": pairing.color_single,
            "depth without colour": pairing.depth_single,
            "changed calibration": self.refused_cameras,
            "frame before calibration": self.uncalibrated,
        }
        return {kind: n for kind, n in sorted(counts.items()) if n}

    def _run(self) -> None:
        try:
            self._receive()
        except BaseException as error:  # handed over to the thread that takes, which raises it
            with self._changed:
                self._failure = error
                self._changed.notify_all()

    def _receive(self) -> None:
        while not self._closed:
            delivery = self._consumer.receive(timeout=_POLL_S)
            if delivery is not None:
                self._understand(delivery)
            elif self._consumer.ended is not None:
                self.source_ended = True
                for frame in self.assembler.finish():
                    self._put_frame(frame, None)
                self._put(EndArrival(self._consumer.ended))
                self._consumer.restart()

    def _understand(self, delivery: Delivery) -> None:
        self.source_ended = False
        message = delivery.message
        if message.topic.startswith("truth/"):
            try:
                self._put(TruthArrival(message.topic.split("/")[1], codec.decode_pose(message)))
            except WireError as error:
                self._consumer.malformed.add(message.topic, str(error))
            return
        if message.topic in self._color_keys:
            self._colors[message.stamp] = message
            if len(self._colors) > _COLORS:
                del self._colors[next(iter(self._colors))]
        for frame in self.assembler.feed(message):
            self._put_frame(frame, delivery)
        if message.topic in self._color_keys and not delivery.lossless:
            self._put_color()
        if self.assembler.camera != self._camera:
            self._settle_camera()

    def _settle_camera(self) -> None:
        """Hold on to the first calibration: another one would tear the trajectory in two without saying so."""
        if self._camera is None:
            self._camera = self.assembler.camera
            assert self._camera is not None
            _LOG.info("calibration: %s", self._camera)
            self._put(CameraArrival(self._camera))
            return
        if not self.refused_cameras:
            _LOG.error("the calibration has changed to %s: refused; restart to use it", self.assembler.camera)
        self.refused_cameras += 1
        self.assembler.camera = self._camera

    def _color_of(self, frame: RgbdFrame) -> Message | None:
        """Return the message of a frame's colour image and forget those before it, which are in no frame."""
        for stamp in list(self._colors):
            message = self._colors.pop(stamp)
            if stamp == frame.stamp:
                return message
        return None

    def _put_frame(self, frame: RgbdFrame, delivery: Delivery | None) -> None:
        color = self._color_of(frame)
        if self._camera is None:
            self.uncalibrated += 1
            return
        live = delivery is not None and not delivery.lossless
        origin = _origin(frame, delivery) if live else None
        with self._changed:
            if live:
                self._drop_oldest(ColorArrival)  # not looked at yet: it is in the frame that comes, or old
                while self._frames >= self._room() and self._drop_oldest(FrameArrival):
                    self._frames -= 1
                    self.overtaken += 1
            else:
                while self._frames >= _LOSSLESS_ROOM and not self._closed:
                    self._changed.wait()
            self._waiting.append(FrameArrival(frame, origin, color))
            self._frames += 1
            self._changed.notify_all()

    def _room(self) -> int:
        """Return how many live frames may wait."""
        now = time.monotonic()
        self._started_at = self._started_at or now
        return self._live_room if now - self._started_at > _STARTING_S else max(self._live_room, _STARTING_ROOM)

    def _put_color(self) -> None:
        waiting = self.assembler.newest_color
        if waiting is not None and self._camera is not None:
            with self._changed:
                self._drop_oldest(ColorArrival)
                self._waiting.append(ColorArrival(*waiting))
                self._changed.notify_all()

    def _put(self, arrival: CameraArrival | TruthArrival | EndArrival) -> None:
        with self._changed:
            if len(self._waiting) >= _MAX_TRUTH and isinstance(arrival, TruthArrival):
                self._consumer.malformed.add("truth", f"more than {_MAX_TRUTH} poses wait")
                return
            self._waiting.append(arrival)
            self._changed.notify_all()

    def _drop_oldest(self, kind: type[Arrival]) -> bool:
        """Take out the oldest waiting arrival of a kind; say whether there was one."""
        oldest = next((i for i, arrival in enumerate(self._waiting) if isinstance(arrival, kind)), None)
        if oldest is not None:
            del self._waiting[oldest]
        return oldest is not None


def _origin(frame: RgbdFrame, delivery: Delivery | None) -> Stamp:
    sent = delivery.sent if delivery is not None else None
    if sent is None or abs(sent - frame.stamp) < _LIVE_CLOCK_NS:
        return frame.stamp
    return sent
