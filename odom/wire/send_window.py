"""Lossless flow from one sensor process to its consumers: a window of frames in flight, closed by acknowledgements.

A consumer holds the liveliness token `<ns>/ack/<name>` and publishes [epoch, serial, waiting] on that key: it has
consumed everything of the sender `epoch` up to `serial` (0, 0: nothing yet); `waiting` is 1, repeated, while it has
nothing to do, and 0 afterwards. The sender stays at most a few frames ahead of the slowest living consumer. A consumer
that dies leaves the window with its token. One that waits for two seconds although messages are on their way to it
has lost them: they are counted, and the sender goes on. The end of the source is sent on `<ns>/end`, in order.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable

from odom.errors import WireError
from odom.wire.codec import decode_numbers
from odom.wire.session import Publisher, Subscriber, WireSession
from odom.wire.topics import Topics

_LOG = logging.getLogger(__name__)

_LOST_AFTER_S = 2.0
"""Seconds that a consumer must wait before messages on their way to it count as lost. Smaller: a slow link is taken for
a loss; larger: a loss stops the source for longer. Equal to the lease after which Zenoh gives up a silent link."""
_FRAMES_IN_FLIGHT = 4
"""Frames that may be ahead of the slowest consumer. Smaller: the consumer waits for the link; larger: more memory on
both sides (1.5 MB a frame) for no more speed. Chosen by hand."""
_MESSAGES_IN_FLIGHT = 64
"""Messages of any kind that may be ahead; below the 256 that a `Subscriber` keeps of a lossless sender, or they are
lost. Smaller: a stream of many small messages waits for the link. Chosen by hand."""
_NEWEST_ACKNOWLEDGEMENTS = 16
"""Acknowledgements of a consumer that wait to be read: only the newest counts, so more would be of no use."""
_POLL_S = 0.05
"""Longest wait, in seconds, before `stop` and lost consumers are looked at again. Smaller: it wakes more often."""
_REPORT_WAITING_S = 2.0
"""Seconds without the wanted consumers after which the log says so; longer than a process of `odom run` starts."""


class _Progress:
    """What one consumer has acknowledged, and since when it waits although more is on its way to it."""

    def __init__(self, acknowledged: int) -> None:
        self.acknowledged = acknowledged
        self.waiting_since: float | None = None

    def take(self, consumed: int, waiting: bool, sent: int) -> None:
        is_progress = consumed > self.acknowledged
        self.acknowledged = max(self.acknowledged, consumed)
        if not waiting or is_progress or self.acknowledged >= sent:
            self.waiting_since = None
        elif self.waiting_since is None:
            self.waiting_since = time.monotonic()


class SendWindow:
    """The sender's side: waits for consumers, and for room in the window before each message."""

    def __init__(self, session: WireSession, topics: Topics, publisher: Publisher) -> None:
        self.lost = 0
        self._publisher = publisher
        self._prefix = len(topics.ack) + 1
        self._frames: deque[int] = deque(maxlen=_FRAMES_IN_FLIGHT)  # bounded, since a live sender never waits for room
        self._consumers: dict[str, _Progress] = {}
        self._changed = threading.Condition()
        self._session = session
        self._acknowledgements = topics.ack_of("*")
        self._subscriber: Subscriber | None = None
        session.watch(self._acknowledgements, self._on_token)

    @property
    def consumers(self) -> tuple[str, ...]:
        """Names of the living consumers."""
        with self._changed:
            return tuple(self._consumers)

    def wait_for_consumers(self, count: int, stop: threading.Event) -> bool:
        """Return True once `count` consumers live, False when `stop` is set before."""
        report_at = time.monotonic() + _REPORT_WAITING_S
        while not stop.is_set():
            with self._changed:
                if len(self._consumers) >= count:
                    return True
                self._changed.wait(_POLL_S)
            if time.monotonic() > report_at:
                _LOG.info("waiting for %d consumer(s); here: %s", count, ", ".join(self.consumers) or "none")
                report_at = float("inf")
        return False

    def listen(self) -> Subscriber:
        """Receive acknowledgements from now on; call this before sending what is to be waited for.

        `wait_for_room` does it by itself. A live sender waits only at its end, and should not listen before.
        """
        if self._subscriber is None:
            self._subscriber = self._session.subscriber((self._acknowledgements,), depth=_NEWEST_ACKNOWLEDGEMENTS)
        return self._subscriber

    def wait_for_room(self, stop: threading.Event) -> bool:
        """Return True once the window has room for a message, False when `stop` is set before.

        While no consumer lives the window has no room: a recorded source waits for one to come back.
        """
        return self._wait(stop, self._has_room)

    def wait_until_consumed(self, stop: threading.Event, timeout: float | None = None) -> bool:
        """Return True once every living consumer has consumed all, False after `timeout` s or when `stop` is set."""

        def consumed() -> bool:
            return all(progress.acknowledged >= self._sent for progress in self._consumers.values())

        return self._wait(stop, consumed, timeout)

    def sent(self, serial: int, is_frame: bool) -> None:
        """Note that a message was sent; colour images count as frames."""
        if is_frame:
            self._frames.append(serial)

    @property
    def _sent(self) -> int:
        return self._publisher.serial - 1

    def _has_room(self) -> bool:
        if not self._consumers:
            return False
        slowest = min(progress.acknowledged for progress in self._consumers.values())
        while self._frames and self._frames[0] <= slowest:
            self._frames.popleft()
        return len(self._frames) < _FRAMES_IN_FLIGHT and self._sent - slowest < _MESSAGES_IN_FLIGHT

    def _wait(self, stop: threading.Event, condition: Callable[[], bool], timeout: float | None = None) -> bool:
        subscriber = self.listen()
        with self._changed:
            if condition() and not stop.is_set():  # by what is known already: a new look costs as much as a message
                return True
        deadline = float("inf") if timeout is None else time.monotonic() + timeout
        while not stop.is_set() and time.monotonic() < deadline:
            self._take_acknowledgements(subscriber, 0.0)
            with self._changed:
                self._give_up_lost()
                if condition():
                    return True
            self._take_acknowledgements(subscriber, _POLL_S)
        return False

    def _take_acknowledgements(self, subscriber: Subscriber, timeout: float) -> None:
        while (delivery := subscriber.receive(timeout)) is not None:
            timeout = 0.0
            try:
                epoch, serial, waiting = decode_numbers(delivery.message)
            except (WireError, ValueError) as error:
                subscriber.malformed.add(delivery.message.topic, str(error))
                continue
            consumed = serial if epoch == self._publisher.epoch else -1
            with self._changed:
                progress = self._consumers.get(delivery.message.topic[self._prefix :])
                if progress is not None and consumed <= self._sent:
                    progress.take(consumed, bool(waiting), self._sent)

    def _give_up_lost(self) -> None:
        for name, progress in self._consumers.items():
            since = progress.waiting_since
            if since is None or progress.acknowledged >= self._sent or time.monotonic() - since < _LOST_AFTER_S:
                continue
            missing = self._sent - progress.acknowledged
            self.lost += missing
            _LOG.warning("%s waits although %d messages are on their way to it: given up as lost", name, missing)
            progress.acknowledged, progress.waiting_since = self._sent, None

    def _on_token(self, key: str, alive: bool) -> None:
        name = key[self._prefix :]
        with self._changed:
            if alive:
                self._consumers.setdefault(name, _Progress(self._sent))
            elif self._consumers.pop(name, None) is not None:
                _LOG.info("consumer %s is gone", name)
            self._changed.notify_all()
