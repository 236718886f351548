"""The recorder: passes a device's messages from the wire into a recording, bytes unchanged."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from odom.errors import WireError
from odom.wire.flow import Consumer
from odom.wire.recording import RecordingWriter
from odom.wire.session import WireSession
from odom.wire.topics import TF, TRUTH, Topics

INTERRUPTED = "interrupted"

_DEPTH = 64
_POLL_S = 0.1
_QUIET_S = 1.0


@dataclass(frozen=True)
class RecorderReport:
    """Colour frames recorded, messages that were sent but not recorded, and why it ended."""

    frames: int
    lost: int
    reason: str


class Recorder:
    """Records frames, calibration and truth, and the estimates if asked for; one life is one recording."""

    def __init__(self, session: WireSession, topics: Topics, writer: RecordingWriter, estimates: bool = True) -> None:
        self._topics = topics
        self._writer = writer
        self._odometry_lives = threading.Event()
        sensed = (
            topics.color,
            topics.color_compressed,
            topics.depth,
            topics.depth_compressed,
            topics.camera_info,
            TRUTH,
        )
        estimated = (topics.odom, topics.pose, topics.path, topics.status, topics.loops, TF) if estimates else ()
        session.watch(topics.alive_of("odometry"), self._odometry)
        self._consumer = Consumer(session, topics, "recorder", (*sensed, *estimated), depth=_DEPTH)
        session.announce(topics.alive_of("recorder"))

    def run(self, stop: threading.Event, progress: Callable[[int], None] = lambda frames: None) -> RecorderReport:
        """Record until the source has ended and the odometry has said its last, or until `stop` is set."""
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
            try:
                self._writer.write(delivery.message)
            except WireError as error:
                self._consumer.malformed(delivery.message.topic, str(error))
                continue
            frames += delivery.message.topic in (self._topics.color, self._topics.color_compressed)
            progress(frames)
        total = self._consumer.total()
        return RecorderReport(frames, total.lost + total.dropped, INTERRUPTED if ended is None else ended)

    def _odometry(self, key: str, alive: bool) -> None:
        if alive:
            self._odometry_lives.set()
        else:
            self._odometry_lives.clear()
