"""The receiving side of a session: one bounded queue, with what was lost, dropped or malformed counted by key."""

import logging
import threading
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import zenoh

from odom.errors import WireError
from odom.wire.delivery import Attachment, Delivery, attachment_of, delivery_of

log = logging.getLogger(__name__)

_RESERVE = 256
_BUDGET = 128 << 20
_MAX_EPOCHS = 64

_Arrival = tuple[str, Attachment | None, zenoh.Sample]


@dataclass
class Counters:
    """What happened to the messages of one key: `lost` on the way, `dropped` here because newer ones came."""

    received: int = 0
    lost: int = 0
    dropped: int = 0
    malformed: int = 0
    bytes: int = 0


class Subscriber:
    """Messages of several keys in the order in which they arrived, in one bounded queue.

    Of a live key at most `depth` messages wait, the newest win; messages of a lossless sender all wait (its flow
    control bounds them; beyond 256 the oldest go) when `lossless`, else they are treated as live ones. Beyond 128 MiB
    the oldest of all go.
    """

    def __init__(self, session: zenoh.Session, keys: Iterable[str], depth: int, lossless: bool) -> None:
        self.counters: dict[str, Counters] = {}
        self._depth = depth
        self._lossless = lossless
        self._queue: deque[_Arrival] = deque()
        self._waiting: dict[str, int] = {}
        self._bytes = 0
        self._expected: dict[tuple[str, int], int] = {}
        self._ready = threading.Condition()
        self._closed = False
        self._complained: set[str] = set()
        handler = zenoh.handlers.Callback(self._arrive, indirect=False)
        try:
            self._subscribers = [session.declare_subscriber(key, handler) for key in keys]
        except zenoh.ZError as error:
            raise WireError(f"cannot subscribe to {', '.join(keys)}: {error}") from error

    def receive(self, timeout: float | None = None) -> Delivery | None:
        """Return the next message, None when none came within `timeout` seconds (None: wait) or after `close`.

        A malformed message is counted, logged once for its key, and passed over.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            with self._ready:
                while not self._queue and not self._closed:
                    left = None if deadline is None else deadline - time.monotonic()
                    if left is not None and left <= 0:
                        return None
                    self._ready.wait(left)
                if not self._queue:
                    return None
                arrival = self._take(0)
            try:
                delivery = delivery_of(*arrival)
            except WireError as error:
                self.malformed(arrival[0], str(error))
                continue
            self.counters[arrival[0]].bytes += len(delivery.message.payload)
            return delivery

    @property
    def waiting(self) -> int:
        """Messages in the queue."""
        return len(self._queue)

    def malformed(self, topic: str, why: str) -> None:
        """Count a message that could not be used, and log the first of its key."""
        self.counters.setdefault(topic, Counters()).malformed += 1
        if topic not in self._complained:
            self._complained.add(topic)
            log.warning("%s: dropped a malformed message (further ones are counted): %s", topic, why)

    def total(self) -> Counters:
        """Return the sums over all keys."""
        total = Counters()
        for counters in list(self.counters.values()):
            for name in vars(total):
                setattr(total, name, getattr(total, name) + getattr(counters, name))
        return total

    def close(self) -> None:
        """Stop; whoever waits in `receive` gets what is queued, then None."""
        with self._ready:
            self._closed = True
            self._ready.notify_all()
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh gives no type
        self._subscribers = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _arrive(self, sample: zenoh.Sample) -> None:
        topic = str(sample.key_expr)
        attachment = attachment_of(sample)
        keep_all = self._lossless and attachment is not None and attachment.lossless
        with self._ready:
            if self._closed:
                return
            if topic not in self.counters and len(self.counters) >= _RESERVE:
                return  # a flood of invented keys must not fill the memory
            counters = self.counters.setdefault(topic, Counters())
            counters.received += 1
            if attachment is not None:
                counters.lost += self._gap(topic, attachment.epoch, attachment.sequence)
            if self._waiting.get(topic, 0) >= (_RESERVE if keep_all else self._depth):
                self._drop(next(i for i, entry in enumerate(self._queue) if entry[0] == topic))
            while self._queue and self._bytes + len(sample.payload) > _BUDGET:
                self._drop(0)
            self._queue.append((topic, attachment, sample))
            self._waiting[topic] = self._waiting.get(topic, 0) + 1
            self._bytes += len(sample.payload)
            self._ready.notify()

    def _take(self, index: int) -> _Arrival:
        entry = self._queue[index]
        del self._queue[index]
        self._waiting[entry[0]] -= 1
        self._bytes -= len(entry[2].payload)
        return entry

    def _drop(self, index: int) -> None:
        topic, _, _ = self._take(index)
        self.counters[topic].dropped += 1

    def _gap(self, topic: str, epoch: int, sequence: int) -> int:
        expected = self._expected.get((topic, epoch))
        if expected is None and len(self._expected) >= _MAX_EPOCHS * max(1, len(self.counters)):
            self._expected.clear()
        self._expected[topic, epoch] = max(sequence + 1, expected or 0)
        return max(0, sequence - expected) if expected is not None else 0
