"""The recorder: passes a device's messages from the wire into a recording, bytes unchanged."""

import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.consumer import Consumer
from odom.wire.idle_detector import IdleDetector
from odom.wire.message import Message
from odom.wire.recording import RecordingWriter
from odom.wire.session import WireSession
from odom.wire.topics import TF, TRUTH, Topics, truth_body

INTERRUPTED = "interrupted"

_DEPTH = 64
"""Messages of a live sender that wait on a key while the disk is busy, 2 s at 30 Hz (raw images also stay below the
subscriber's bound in bytes). Smaller: more of a live stream is missing in the file; larger: more memory."""
_POLL_S = 0.1
"""Longest wait for a message, in seconds; then a chunk may be written, and `stop` and the end are looked at."""
_QUIET_S = 1.0
"""Seconds without a message of the device, after its odometry has gone, that end a recording whose source has ended.
Smaller: last poses on a slow link are missing in the file; larger: the end takes longer. Chosen by hand."""
_HELD = 64
"""Messages that wait for the first image, the newest; more than the odometry sends before it. Larger: more memory."""
_NEAR_NS = 10_000_000_000
"""Nanoseconds within which a stamp belongs to the images' time line. Smaller: late poses are logged at another time
than their stamp; larger: a host clock that is this near to an old recording's is not noticed."""


@dataclass(frozen=True)
class RecorderReport:
    """Colour frames recorded, messages that were sent but not recorded, and why it ended."""

    frames: int
    lost: int
    reason: str


class Timeline:
    """At which time each message is logged: on the images' time line or, before the first image, on that of truth.

    Truth and estimates have stamps near the images'. Status has the host's clock, which is years away when an old
    recording is played: it is logged at the time of the image before it, or held until there is one.
    """

    def __init__(self, image_keys: Collection[str]) -> None:
        self._image_keys = image_keys
        self._has_images = False
        self._now: Stamp | None = None
        self._held: deque[Message] = deque(maxlen=_HELD)

    def place(self, message: Message) -> list[tuple[Stamp, Message]]:
        """Return the messages that can be logged now that this one has come, each with its time."""
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
        """Return the messages that are still held at the end, each at its own time, since no image came."""
        return [(message.stamp, message) for message in self._release()]

    def _beside(self, message: Message, now: Stamp) -> tuple[Stamp, Message]:
        return message.stamp if abs(message.stamp - now) < _NEAR_NS else now, message

    def _release(self) -> list[Message]:
        held = list(self._held)
        self._held.clear()
        return held


class Recorder:
    """Records frames, calibration and truth, and the estimates if asked for, into one recording."""

    def __init__(self, session: WireSession, topics: Topics, writer: RecordingWriter, estimates: bool = True) -> None:
        self._topics = topics
        self._writer = writer
        self._estimates = estimates
        self._frames = 0
        self._ended: str | None = None
        self._odometry_lives = False
        self._odometry_idles = IdleDetector()
        self._heard_at = time.monotonic()
        t = topics
        images = (*t.color_keys, *t.depth_keys, t.camera_info, t.depth_info, t.device)
        estimated = (
            (t.odom, t.pose, t.chain, t.chain_closed, t.path, f"{t.path}/*", t.status, t.loops, TF) if estimates else ()
        )
        session.watch(topics.alive_of("odometry"), self._odometry_changed)
        self._images = images
        self._timeline = Timeline(images)
        self._consumer = Consumer(session, topics, "recorder", (*images, TRUTH, *estimated), depth=_DEPTH)
        session.announce(topics.alive_of("recorder"))

    def run(self, stop: threading.Event, progress: Callable[[int], None] = lambda frames: None) -> RecorderReport:
        """Record until the source has ended and the odometry has sent everything, or until `stop` is set.

        It has sent everything when it is gone and nothing has come for a second, or when it has reported for five
        seconds that it is idle (while it saves its results it reports nothing). A source that was started again
        meanwhile has not ended. Truth and the messages of other devices do not delay the end. What has come by then,
        while the disk was busy, is still written.
        """
        while not stop.is_set() and not (self._ended is not None and self._has_everything()):
            if not self._record_next(_POLL_S):
                self._writer.flush_if_due()
            progress(self._frames)
        self._consumer.close()
        while self._record_next(0.0):
            progress(self._frames)
        self._write(self._timeline.rest())
        total = self._consumer.total()
        reason = INTERRUPTED if self._ended is None else self._ended
        return RecorderReport(self._frames, total.lost + total.dropped, reason)

    def _record_next(self, timeout_s: float) -> bool:
        """Record the next message, or note the end of the source; return whether either has come within the time."""
        delivery = self._consumer.receive(timeout_s)
        if delivery is not None:
            if delivery.message.topic in self._images:
                self._ended = None
            self._hear(delivery.message.topic)
            self._write(self._timeline.place(delivery.message))
        elif self._consumer.ended is not None:
            self._ended = self._consumer.ended
            self._consumer.restart()
        else:
            return False
        return True

    def _hear(self, topic: str) -> None:
        if not topic.startswith(f"{self._topics.namespace}/"):
            return
        self._heard_at = time.monotonic()
        if topic == self._topics.status:
            self._odometry_idles.note_report()
        else:
            self._odometry_idles.note_work()

    def _has_everything(self) -> bool:
        if self._estimates and self._odometry_lives:
            return self._odometry_idles.is_idle
        return time.monotonic() - self._heard_at > _QUIET_S

    def _write(self, placed: list[tuple[Stamp, Message]]) -> None:
        """Write each message at its time, and count the colour frames among them."""
        for at, message in placed:
            try:
                self._writer.write(message, at)
            except WireError as error:
                self._consumer.malformed.add(message.topic, str(error))
                continue
            self._frames += message.topic in self._topics.color_keys

    def _odometry_changed(self, key: str, alive: bool) -> None:
        self._heard_at = time.monotonic()  # its last messages may still be on their way
        self._odometry_lives = alive
