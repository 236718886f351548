"""Lossless flow from one sensor process to its consumers: a window of frames in flight, closed by acknowledgements.

A consumer holds the liveliness token `<ns>/ack/<name>` and publishes there [epoch, serial, waiting]: everything up to
`serial` of the sender `epoch` is consumed (0, 0: nothing yet); `waiting` is 1, repeated, while it idles, and 0 once it
does no longer. The sender keeps at most a few frames ahead of the slowest living consumer. A consumer that dies leaves
the window with its token; one that idles for two seconds although messages are on their way to it has lost them: they
are counted and it is passed over. The end of the source travels in order behind the last message on `<ns>/end`.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import decode_numbers, decode_text, encode_numbers
from odom.wire.malformed import Malformed
from odom.wire.session import Counters, Delivery, Publisher, Subscriber, WireSession
from odom.wire.subscriber import SMALL
from odom.wire.topics import Topics

log = logging.getLogger(__name__)

_IDLE_REPORT_S = 0.25
_LOST_AFTER_S = 2.0
_SMALL_DEPTH = 64
_MESSAGES_IN_FLIGHT = 64


class Consumer:
    """Receives a device's messages and acknowledges each one when the next is asked for.

    `name` is this consumer's own (`odometry`, `recorder`): two of one name would acknowledge for each other. The end is
    looked for before the other keys: once it has come, so has all that a live source sent before it (see `Inlet`).
    """

    def __init__(self, session: WireSession, topics: Topics, name: str, keys: Iterable[str], depth: int = 3) -> None:
        self.ended: str | None = None
        self._key = topics.ack_of(name)
        self._end = topics.end
        self._subscriber = session.subscriber((topics.end, *keys), depth, _SMALL_DEPTH, lossless=True)
        self._publisher = session.publisher(urgent=True)
        self._last: Delivery | None = None
        self._consumed = (0, 0)
        self._is_waiting = False
        session.announce(self._key)

    def receive(self, timeout: float | None = None) -> Delivery | None:
        """Return the next message in the sender's order; None after `timeout` seconds, or when the source has ended.

        `ended` then says why. Asking for a message acknowledges the one before.
        """
        if self.ended is not None:
            return None
        self._acknowledge_consumed()
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            left = _IDLE_REPORT_S if deadline is None else min(_IDLE_REPORT_S, deadline - time.monotonic())
            delivery = self._subscriber.receive(max(0.0, left))
            if delivery is None:
                self._tell(waiting=True)
                if deadline is not None and time.monotonic() >= deadline:
                    return None
                continue
            if self._is_waiting:
                self._tell(waiting=False)
            if delivery.lossless or delivery.message.topic == self._end:
                self._last = delivery
            if delivery.message.topic != self._end:
                return delivery
            try:
                self.ended = decode_text(delivery.message)
            except WireError as error:
                self.malformed.add(delivery.message.topic, str(error))
                continue
            self._tell(waiting=False)
            return None

    def restart(self) -> None:
        """Go on after the end of a source, for a service that outlives its sensors."""
        self.ended = None

    @property
    def malformed(self) -> Malformed:
        """What could not be used; whoever finds a delivery to be so adds it."""
        return self._subscriber.malformed

    @property
    def counters(self) -> dict[str, Counters]:
        """What happened to the messages of each key."""
        return self._subscriber.counters

    def total(self) -> Counters:
        """Return the sums over all keys."""
        return self._subscriber.total()

    def _acknowledge_consumed(self) -> None:
        """Acknowledge the last message, unless it is a small one among others that wait: a later one speaks for it.

        Once only: told at each poll, it would hide that this idles.
        """
        if self._last is not None and (self._subscriber.waiting == 0 or len(self._last.message.payload) > SMALL):
            self._tell(waiting=False)

    def _tell(self, waiting: bool) -> None:
        last, self._last, self._is_waiting = self._last, None, waiting
        if last is not None and last.epoch is not None and last.serial is not None:
            self._consumed = (last.epoch, last.serial)
        numbers = (*self._consumed, int(waiting))
        self._publisher.put(encode_numbers(self._key, Stamp(time.time_ns()), numbers))


class _Credit:
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


class Window:
    """The sender's side: waits for consumers, and for room in the window before each message."""

    def __init__(self, session: WireSession, topics: Topics, publisher: Publisher, frames: int = 4) -> None:
        self.lost = 0
        self._publisher = publisher
        self._prefix = len(topics.ack) + 1
        self._frames_allowed = frames
        self._frames: deque[int] = deque(maxlen=frames)  # a live sender waits for no room, and so clears none
        self._credits: dict[str, _Credit] = {}
        self._changed = threading.Condition()
        self._session = session
        self._acknowledgements = topics.ack_of("*")
        self._subscriber: Subscriber | None = None
        session.watch(self._acknowledgements, self._token)

    @property
    def consumers(self) -> tuple[str, ...]:
        """Names of the living consumers."""
        with self._changed:
            return tuple(self._credits)

    def wait_for_consumers(self, count: int, stop: threading.Event) -> bool:
        """Return True once `count` consumers live, False when `stop` is set before."""
        said = time.monotonic() + 2.0
        while not stop.is_set():
            with self._changed:
                if len(self._credits) >= count:
                    return True
                self._changed.wait(0.1)
            if time.monotonic() > said:
                log.info("waiting for %d consumer(s); here: %s", count, ", ".join(self.consumers) or "none")
                said = float("inf")
        return False

    def listen(self) -> Subscriber:
        """Receive acknowledgements from now on: to be called before what is to be waited for is sent.

        `wait_for_room` does so; a live sender waits for nothing before its end, and would only be kept from its work.
        """
        if self._subscriber is None:
            self._subscriber = self._session.subscriber((self._acknowledgements,), depth=16)
        return self._subscriber

    def wait_for_room(self, stop: threading.Event) -> bool:
        """Return True once the window has room for a message, False when `stop` is set before.

        While no consumer lives the window has no room: a recorded source waits for one to come back.
        """
        return self._wait(stop, self._has_room)

    def wait_until_consumed(self, stop: threading.Event, timeout: float | None = None) -> bool:
        """Return True once every living consumer has consumed all, False after `timeout` s or when `stop` is set."""

        def consumed() -> bool:
            return all(credit.acknowledged >= self._sent for credit in self._credits.values())

        return self._wait(stop, consumed, timeout)

    def sent(self, serial: int, is_frame: bool) -> None:
        """Take note of a message on its way; colour images count as frames."""
        if is_frame:
            self._frames.append(serial)

    @property
    def _sent(self) -> int:
        return self._publisher.serial - 1

    def _has_room(self) -> bool:
        if not self._credits:
            return False
        slowest = min(credit.acknowledged for credit in self._credits.values())
        while self._frames and self._frames[0] <= slowest:
            self._frames.popleft()
        return len(self._frames) < self._frames_allowed and self._sent - slowest < _MESSAGES_IN_FLIGHT

    def _wait(self, stop: threading.Event, condition: Callable[[], bool], timeout: float | None = None) -> bool:
        subscriber = self.listen()
        deadline = float("inf") if timeout is None else time.monotonic() + timeout
        while not stop.is_set() and time.monotonic() < deadline:
            self._take_acknowledgements(subscriber, 0.0)
            with self._changed:
                self._give_up_lost()
                if condition():
                    return True
            self._take_acknowledgements(subscriber, 0.05)
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
                credit = self._credits.get(delivery.message.topic[self._prefix :])
                if credit is not None and consumed <= self._sent:
                    credit.take(consumed, bool(waiting), self._sent)

    def _give_up_lost(self) -> None:
        for name, credit in self._credits.items():
            since = credit.waiting_since
            if since is None or credit.acknowledged >= self._sent or time.monotonic() - since < _LOST_AFTER_S:
                continue
            missing = self._sent - credit.acknowledged
            self.lost += missing
            log.warning("%s waits although %d messages are on their way to it: given up as lost", name, missing)
            credit.acknowledged, credit.waiting_since = self._sent, None

    def _token(self, key: str, alive: bool) -> None:
        name = key[self._prefix :]
        with self._changed:
            if alive:
                self._credits.setdefault(name, _Credit(self._sent))
            elif self._credits.pop(name, None) is not None:
                log.info("consumer %s is gone", name)
            self._changed.notify_all()
