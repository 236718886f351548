"""The sensor process: publishes what a source yields, at the pace of its consumers, of the clock, or of the device."""

import logging
import queue
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from odom.frame import Stamp
from odom.wire import Message, Topics
from odom.wire.codec import encode_text, restamp
from odom.wire.namesakes import Namesakes
from odom.wire.publisher import Mirror
from odom.wire.send_window import SendWindow
from odom.wire.session import Publisher, WireSession
from sensors.pace import Pace
from sensors.source import Source, SourceOptions

log = logging.getLogger(__name__)

END_OF_SOURCE = "end of source"
INTERRUPTED = "interrupted"

_READ_AHEAD = 8
"""Messages of a recording decoded before they are sent: fewer make consumers wait for the disk, more need memory."""
_CALIBRATION_PERIOD_S = 1.0
"""Seconds between two calibration messages, for consumers that only listen; that long they may wait for one."""
_FAREWELL_S = 2.0
"""Seconds that consumers have to take the end of the source when it was interrupted or live."""


@dataclass(frozen=True)
class SensorReport:
    """What a sensor process did: colour frames and messages sent, messages lost by consumers, and how it ended."""

    frames: int
    messages: int
    lost: int
    reason: str


class SensorProcess:
    """Runs one source on one session until it ends or `stop` is set; `ended` says how it did.

    `mirror` is given every message, too.
    """

    def __init__(
        self,
        session: WireSession,
        source: Source,
        options: SourceOptions,
        consumers: int,
        mirror: Mirror | None = None,
    ) -> None:
        self.frames = 0
        self.ended: str | None = None
        self._topics: Topics = options.topics
        self._calibration_keys = options.topics.depth_info, options.topics.camera_info
        self._source = source
        self._consumers = consumers
        self._live = not source.lossless or options.realtime
        self._pace = Pace(options.rate) if source.lossless and options.realtime else None
        self._publisher: Publisher = session.publisher(lossless=not self._live, mirror=mirror)
        self._window = SendWindow(session, options.topics, self._publisher)
        self._calibration: dict[str, Message] = {}
        self._calibration_due = 0.0
        self._informed: tuple[str, ...] = ()
        session.announce(options.topics.alive)
        self._namesakes = Namesakes(session, options.topics, "sensor", log.warning)

    def run(self, stop: threading.Event, progress: Callable[[int], None] = lambda frames: None) -> SensorReport:
        """Publish everything, then the end of the source; `progress` is called with the colour frames sent so far.

        Raises SourceError from the source, after it has told the consumers that the source ended.
        """
        reason = INTERRUPTED
        ahead = _ReadAhead(self._source)
        try:
            if self._source.lossless:
                ahead.start(stop)
            if self._window.wait_for_consumers(self._consumers, stop):
                for message in ahead.messages(stop):
                    if not self._send(message, stop):
                        break
                    progress(self.frames)
                else:
                    reason = INTERRUPTED if stop.is_set() else END_OF_SOURCE
        except Exception as error:  # of any kind: the consumers learn the reason
            reason = f"failed: {error}"
            raise
        finally:
            self._source.close()
            ahead.close()
            self.ended = reason
            self._announce_end(reason, stop)
        return SensorReport(self.frames, self._publisher.serial, self._window.lost, reason)

    def _send(self, message: Message, stop: threading.Event) -> bool:
        is_calibration = message.topic in self._calibration_keys
        if self._pace is not None and not is_calibration and not self._wait_until_due(message.stamp, self._pace, stop):
            return False
        if not self._live and not self._window.wait_for_room(stop):
            return False
        self._repeat_calibration(message)
        is_frame = message.topic in self._topics.color_keys
        self._window.sent(self._publisher.put(message), is_frame)
        self.frames += is_frame
        return True

    def _repeat_calibration(self, message: Message) -> None:
        """Send the calibration whenever a consumer has joined, and once a second for those who only listen."""
        now, consumers = time.monotonic(), self._window.consumers
        if message.topic in self._calibration_keys:
            self._calibration[message.topic] = message
        elif self._calibration and (now >= self._calibration_due or consumers != self._informed):
            for known in self._calibration.values():
                self._publisher.put(restamp(known, message.stamp))
        else:
            return
        self._calibration_due, self._informed = now + _CALIBRATION_PERIOD_S, consumers

    def _wait_until_due(self, stamp: Stamp, pace: Pace, stop: threading.Event) -> bool:
        now = time.monotonic()
        return not stop.wait(max(0.0, pace.due(stamp, now) - now))

    def _announce_end(self, reason: str, stop: threading.Event) -> None:
        self._window.listen()
        self._publisher.put(encode_text(self._topics.end, Stamp(time.time_ns()), reason))
        complete = reason == END_OF_SOURCE and not self._live
        self._window.wait_until_consumed(stop if complete else threading.Event(), None if complete else _FAREWELL_S)


class _ReadAhead:
    """The source's messages, a few of them read and decoded ahead in a thread while others wait to be sent."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._waiting: queue.Queue[Message | BaseException | None] = queue.Queue(_READ_AHEAD)
        self._abandoned = threading.Event()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, name="source", daemon=True)

    def start(self, stop: threading.Event) -> None:
        """Begin to read and wait until the first messages are ready, so that loading and compiling are over by then."""
        self._thread.start()
        while not (stop.is_set() or self._waiting.full() or self._ended.wait(0.01)):
            pass

    def messages(self, stop: threading.Event) -> Iterator[Message]:
        """Yield until the source ends or `stop` is set; raises what the source raised."""
        if not self._thread.is_alive() and not self._ended.is_set():
            self._thread.start()
        while not stop.is_set():
            try:
                item = self._waiting.get(timeout=0.1)
            except queue.Empty:
                continue
            if item is None:
                return
            if isinstance(item, BaseException):
                raise item
            yield item

    def close(self) -> None:
        """Let the thread go."""
        self._abandoned.set()
        if self._thread.is_alive():
            self._thread.join(timeout=_FAREWELL_S)

    def _read(self) -> None:
        last: BaseException | None = None
        try:
            for message in self._source.messages():
                if not self._put(message):
                    return
        except BaseException as error:  # handed over to the thread that publishes, which raises it
            last = error
        self._ended.set()
        self._put(last)

    def _put(self, item: Message | BaseException | None) -> bool:
        while not self._abandoned.is_set():
            try:
                self._waiting.put(item, timeout=0.1)
            except queue.Full:
                continue
            return True
        return False
