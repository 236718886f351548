"""The recorder: passes a device's messages from the wire into a recording, bytes unchanged."""

import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.flow import Consumer
from odom.wire.idling import Idling
from odom.wire.message import Message
from odom.wire.recording import RecordingWriter
from odom.wire.session import WireSession
from odom.wire.topics import TF, TRUTH, Topics, truth_body

INTERRUPTED = "interrupted"

_DEPTH = 64
_POLL_S = 0.1
_QUIET_S = 1.0
_HELD = 64
_NEAR_NS = 10_000_000_000


@dataclass(frozen=True)
class RecorderReport:
    """Colour frames recorded, messages that were sent but not recorded, and why it ended."""

    frames: int
    lost: int
    reason: str


class Timeline:
    """When a message belongs on the recording's time line: that of the images, before the first of them that of truth.

    Truth and estimates carry stamps near the images'. Status carries the host's clock, which is years away when an old
    recording is played: it is logged at the image before it, or held until there is one. Pure.
    """

    def __init__(self, image_keys: Collection[str]) -> None:
        self._image_keys = image_keys
        self._has_images = False
        self._now: Stamp | None = None
        self._held: deque[Message] = deque(maxlen=_HELD)

    def place(self, message: Message) -> list[tuple[Stamp, Message]]:
        """Return what can be logged by this message, each with its time."""
        is_image = message.topic in self._image_keys
        if is_image or (not self._has_images and truth_body(message.topic) is not None):
            self._has_images = is_image
            self._now = message.stamp
            return [(message.stamp, message), *(self._beside(held, message.stamp) for held in self._release())]
        if self._now is None:
            self._held.append(message)
            return []
        return [self._beside(message, self._now)]

    def rest(self) -> list[tuple[Stamp, Message]]:
        """Return what is held still, at its own time: nothing else came."""
        return [(message.stamp, message) for message in self._release()]

    def _beside(self, message: Message, now: Stamp) -> tuple[Stamp, Message]:
        return message.stamp if abs(message.stamp - now) < _NEAR_NS else now, message

    def _release(self) -> list[Message]:
        held = list(self._held)
        self._held.clear()
        return held


class Recorder:
    """Records frames, calibration and truth, and the estimates if asked for; one life is one recording."""

    def __init__(self, session: WireSession, topics: Topics, writer: RecordingWriter, estimates: bool = True) -> None:
        self._topics = topics
        self._writer = writer
        self._estimates = estimates
        self._odometry_lives = threading.Event()
        self._odometry_idles = Idling()
        self._heard_at = time.monotonic()
        images = (
            topics.color,
            topics.color_compressed,
            topics.depth,
            topics.depth_compressed,
            topics.camera_info,
            topics.device,
        )
        estimated = (topics.odom, topics.pose, topics.path, topics.status, topics.loops, TF) if estimates else ()
        session.watch(topics.alive_of("odometry"), self._odometry)
        self._images = images
        self._timeline = Timeline(images)
        self._consumer = Consumer(session, topics, "recorder", (*images, TRUTH, *estimated), depth=_DEPTH)
        session.announce(topics.alive_of("recorder"))

    def run(self, stop: threading.Event, progress: Callable[[int], None] = lambda frames: None) -> RecorderReport:
        """Record until the source has ended and the odometry has said its last, or until `stop` is set.

        It has when it is gone and silent for a second, or reports for five seconds that it has nothing to do; while it
        saves its results it says nothing. A source that was started again meanwhile has not ended. Truth, which may
        come from elsewhere, and what comes of other devices hold nothing up.
        """
        frames, ended = 0, None
        while not stop.is_set():
            delivery = self._consumer.receive(_POLL_S)
            if delivery is not None:
                if delivery.message.topic in self._images:
                    ended = None
                self._hear(delivery.message.topic)
                frames += self._write(self._timeline.place(delivery.message))
                progress(frames)
            else:
                self._writer.flush_if_due()
            if self._consumer.ended is not None:
                ended = self._consumer.ended
                self._consumer.restart()
            if ended is not None and self._all_is_said():
                break
        self._write(self._timeline.rest())
        total = self._consumer.total()
        return RecorderReport(frames, total.lost + total.dropped, INTERRUPTED if ended is None else ended)

    def _hear(self, topic: str) -> None:
        if not topic.startswith(f"{self._topics.namespace}/"):
            return
        self._heard_at = time.monotonic()
        if topic == self._topics.status:
            self._odometry_idles.reports()
        else:
            self._odometry_idles.works()

    def _all_is_said(self) -> bool:
        if self._estimates and self._odometry_lives.is_set():
            return self._odometry_idles.is_long
        return time.monotonic() - self._heard_at > _QUIET_S

    def _write(self, placed: list[tuple[Stamp, Message]]) -> int:
        """Write each message at its time; return how many colour frames were among them."""
        frames = 0
        for at, message in placed:
            try:
                self._writer.write(message, at)
            except WireError as error:
                self._consumer.malformed.add(message.topic, str(error))
                continue
            frames += message.topic in (self._topics.color, self._topics.color_compressed)
        return frames

    def _odometry(self, key: str, alive: bool) -> None:
        self._heard_at = time.monotonic()  # its last words may be on their way still
        if alive:
            self._odometry_lives.set()
        else:
            self._odometry_lives.clear()
