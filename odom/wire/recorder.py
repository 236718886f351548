"""The recorder: passes a device's messages from the wire into a recording, bytes unchanged."""

import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.flow import Consumer
from odom.wire.message import Message
from odom.wire.recording import RecordingWriter
from odom.wire.session import WireSession
from odom.wire.topics import TF, TRUTH, Topics

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
    """When a message belongs on the recording's time line, which is that of the images.

    Truth and estimates carry stamps near the images'. Status carries the host's clock, which is years away when an old
    recording is played: it is logged at the image before it, or held until there is one. Pure.
    """

    def __init__(self, image_keys: Collection[str]) -> None:
        self._image_keys = image_keys
        self._now: Stamp | None = None
        self._held: deque[Message] = deque(maxlen=_HELD)

    def place(self, message: Message) -> list[tuple[Stamp, Message]]:
        """Return what can be logged by this message, each with its time."""
        if message.topic not in self._image_keys:
            if self._now is None:
                self._held.append(message)
                return []
            near = abs(message.stamp - self._now) < _NEAR_NS
            return [(message.stamp if near else self._now, message)]
        self._now = message.stamp
        placed = [(message.stamp, message)]
        while self._held:
            placed += self.place(self._held.popleft())
        return placed


class Recorder:
    """Records frames, calibration and truth, and the estimates if asked for; one life is one recording."""

    def __init__(self, session: WireSession, topics: Topics, writer: RecordingWriter, estimates: bool = True) -> None:
        self._topics = topics
        self._writer = writer
        self._odometry_lives = threading.Event()
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

        A source that was started again meanwhile has not ended.
        """
        frames, ended = 0, None
        quiet_since = time.monotonic()
        while not stop.is_set():
            delivery = self._consumer.receive(_POLL_S)
            now = time.monotonic()
            if delivery is None:
                self._writer.flush_if_due()
                if self._consumer.ended is not None:
                    ended = self._consumer.ended
                    self._consumer.restart()
                if ended is not None and not self._odometry_lives.is_set() and now - quiet_since > _QUIET_S:
                    break
                continue
            quiet_since = now
            if delivery.message.topic in self._images:
                ended = None
            for at, message in self._timeline.place(delivery.message):
                try:
                    self._writer.write(message, at)
                except WireError as error:
                    self._consumer.malformed.add(message.topic, str(error))
                    continue
                frames += message.topic in (self._topics.color, self._topics.color_compressed)
            progress(frames)
        total = self._consumer.total()
        return RecorderReport(frames, total.lost + total.dropped, INTERRUPTED if ended is None else ended)

    def _odometry(self, key: str, alive: bool) -> None:
        if alive:
            self._odometry_lives.set()
        else:
            self._odometry_lives.clear()
