"""The consumers' side of lossless flow (see `odom.wire.send_window`): receive, and acknowledge what was consumed."""

import time
from collections.abc import Iterable

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import decode_text, encode_numbers
from odom.wire.session import Delivery, WireSession
from odom.wire.subscriber import SMALL_BYTES
from odom.wire.topics import Topics
from odom.wire.unheard import Unheard

_WAITING_REPORT_S = 0.25
"""Seconds between two reports of a consumer that waits. Smaller: more messages; larger: a sender needs longer to find
that messages were lost, for which it waits 2 s. Chosen by hand."""
_SMALL_DEPTH = 64
"""Small messages (poses, status) of a live sender that wait on a key, 2 s of a 30 Hz stream. Smaller: more of them are
dropped while the consumer is busy; larger: it works on older ones. Chosen by hand."""


class Consumer:
    """Receives a device's messages and acknowledges each one when the next is asked for.

    `name` (`odometry`, `recorder`) must be this consumer's own: two of one name would acknowledge for each other. The
    key of the end is subscribed before all others: once the end has come, so has all that a live source sent before.
    `malformed`, `counters` and `total` are those of the `Subscriber`; `ended` says why the source has ended. While
    nothing has come at all, it is logged now and then.
    """

    def __init__(self, session: WireSession, topics: Topics, name: str, keys: Iterable[str], depth: int = 3) -> None:
        self.ended: str | None = None
        self._key = topics.ack_of(name)
        self._end = topics.end
        self._subscriber = session.subscriber((topics.end, *keys), depth, _SMALL_DEPTH, lossless=True)
        self.malformed, self.counters = self._subscriber.malformed, self._subscriber.counters
        self.total = self._subscriber.total
        self._publisher = session.publisher(urgent=True)
        self._last: Delivery | None = None
        self._consumed = (0, 0)
        self._is_waiting = self._has_heard = False
        self._unheard = Unheard(session, topics)
        session.announce(self._key)

    def receive(self, timeout: float | None = None) -> Delivery | None:
        """Return the next message in the sender's order; None after `timeout` seconds, or when the source has ended.

        Asking for a message acknowledges the one before.
        """
        if self.ended is not None:
            return None
        self._acknowledge_consumed()
        deadline = float("inf") if timeout is None else time.monotonic() + timeout
        while True:
            delivery = self._subscriber.receive(max(0.0, min(_WAITING_REPORT_S, deadline - time.monotonic())))
            if delivery is None:
                self._report(waiting=True)
                if not self._has_heard:
                    self._unheard.look()
                if time.monotonic() >= deadline:
                    return None
                continue
            self._has_heard = True
            if self._is_waiting:
                self._report(waiting=False)
            if delivery.lossless or delivery.message.topic == self._end:
                self._last = delivery
            if delivery.message.topic != self._end:
                return delivery
            try:
                self.ended = decode_text(delivery.message)
            except WireError as error:
                self.malformed.add(delivery.message.topic, str(error))
                continue
            self._report(waiting=False)
            return None

    def restart(self) -> None:
        """Go on after the end of a source, for a service that outlives its sensors."""
        self.ended = None

    def close(self) -> None:
        """Let nothing more come; what has come can still be received."""
        self._subscriber.close()

    def _acknowledge_consumed(self) -> None:
        """Acknowledge the last message, unless it is small and others wait: a later acknowledgement then includes it.

        It is done once only: a repeated 0 for `waiting` would hide that this consumer waits.
        """
        if self._last is not None and (self._subscriber.waiting == 0 or len(self._last.message.payload) > SMALL_BYTES):
            self._report(waiting=False)

    def _report(self, waiting: bool) -> None:
        last, self._last, self._is_waiting = self._last, None, waiting
        if last is not None and last.epoch is not None and last.serial is not None:
            self._consumed = (last.epoch, last.serial)
        self._publisher.put(encode_numbers(self._key, Stamp(time.time_ns()), (*self._consumed, int(waiting))))
