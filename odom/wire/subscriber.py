"""The receiving side of a session: one bounded queue, with what was lost, dropped or malformed counted by key."""

import threading
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import NamedTuple, Self

import zenoh

from odom.errors import WireError
from odom.wire.delivery import Attachment, Delivery, delivery_of
from odom.wire.inlet import Arrival, Inlet
from odom.wire.malformed import Malformed

SMALL = 4096

_RESERVE = 256
_BUDGET = 128 << 20
_MAX_KNOWN, _MAX_NEW = 256, 4096
_PLAUSIBLE_GAP = 1000


class _Waiting(NamedTuple):
    slot: tuple[str, int | None]
    arrival: Arrival


@dataclass
class Counters:
    """What happened to the messages of one key: `lost` on the way, `dropped` here because newer ones came."""

    received: int = 0
    lost: int = 0
    dropped: int = 0
    bytes: int = 0


class _Senders:
    """Who sends on which key, told by sequence numbers that go on: a flood of nonsense is one stranger, not many.

    A sender is known from its second message on; until then, and without an attachment, it is a stranger.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[str, int], int] = {}
        self._new: dict[tuple[str, int], int] = {}

    def take(self, topic: str, attachment: Attachment | None) -> tuple[int | None, int, bool]:
        """Return the sender's epoch (None: stranger), messages missing before this one, and if it is known just now."""
        if attachment is None:
            return None, 0, False
        key, sequence = (topic, attachment.epoch), attachment.sequence
        expected, introduced = self._known.get(key), False
        if expected is None:
            expected, introduced = self._new.pop(key, None), True
            if expected is None or not 0 <= sequence - expected < _PLAUSIBLE_GAP:
                _bounded(self._new, _MAX_NEW)[key] = sequence + 1
                return None, 0, False
            _bounded(self._known, _MAX_KNOWN)
        self._known[key] = max(sequence + 1, expected)
        return attachment.epoch, max(0, sequence - expected), introduced


def _bounded(senders: dict[tuple[str, int], int], limit: int) -> dict[tuple[str, int], int]:
    """Return the dictionary after its oldest entry has made room, if need be."""
    if len(senders) >= limit:
        del senders[next(iter(senders))]
    return senders


class Subscriber:
    """Messages of several keys in the order in which they arrived (see `Inlet`), in one bounded queue.

    Of a live sender's key at most `depth` messages wait (`small_depth` of those of 4 kB or less), the newest win.
    Messages of a lossless sender all wait (its flow control bounds them; beyond 256 the oldest go) when `lossless`,
    else they are treated as live ones. Beyond 128 MiB the oldest of all go. Strangers (see `_Senders`) crowd out each
    other only, and where a key is flooded with nonsense (see `Malformed`) what comes without an attachment is not
    looked at for a second.
    """

    def __init__(
        self, session: zenoh.Session, keys: Iterable[str], depth: int, small_depth: int, lossless: bool
    ) -> None:
        keys = tuple(keys)
        # those of invented names, below a wildcard, find no room once there are many; those asked for by name always do
        self.counters = {key: Counters() for key in keys if "*" not in key}
        self._most_counters = len(self.counters) + _RESERVE
        self.malformed = Malformed()
        self._depth = depth
        self._small_depth = max(depth, small_depth)
        self._lossless = lossless
        self._queue: deque[_Waiting] = deque()
        self._waiting: dict[tuple[str, int | None], int] = {}
        self._bytes = 0
        self._senders = _Senders()
        self._ready = threading.Condition()
        self._closed = False
        try:
            self._inlet = Inlet(session, keys, self.malformed, self._enqueue)
        except zenoh.ZError as error:
            raise WireError(f"cannot subscribe to {', '.join(keys)}: {error}") from error

    def receive(self, timeout: float | None = None) -> Delivery | None:
        """Return the next message, None when none came within `timeout` seconds (None: wait) or after `close`.

        A message that is malformed is counted and passed over; whoever finds out later adds it to `malformed`.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while (waiting := self._next(deadline)) is not None:
            topic, attachment, sample = waiting.arrival
            try:
                delivery = delivery_of(topic, attachment, sample)
            except WireError as error:
                self.malformed.add(topic, str(error))
                continue
            self.counters[topic].bytes += len(delivery.message.payload)
            return delivery
        return None

    @property
    def waiting(self) -> int:
        """Messages in the queue."""
        return len(self._queue)

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
        self._inlet.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _next(self, deadline: float | None) -> _Waiting | None:
        waiting = self._wait(None if deadline is None else max(0.0, deadline - time.monotonic()))
        if waiting is None and not self._closed:
            self._inlet.fetch()  # it may have rung before it had come
            waiting = self._wait(0.0)
        return waiting

    def _wait(self, timeout: float | None) -> _Waiting | None:
        with self._ready:
            self._ready.wait_for(lambda: self._queue or self._closed, timeout)
            return self._take(0) if self._queue else None

    def _enqueue(self, arrivals: list[Arrival]) -> None:
        with self._ready:
            for arrival in arrivals:
                self._add(arrival)
            self._ready.notify_all()

    def _add(self, arrival: Arrival) -> None:
        topic, attachment, sample = arrival
        if topic not in self.counters and len(self.counters) >= self._most_counters:
            return  # a flood of invented keys must not fill the memory
        counters = self.counters.setdefault(topic, Counters())
        counters.received += 1
        epoch, missing, introduced = self._senders.take(topic, attachment)
        counters.lost += missing
        slot = (topic, epoch)
        if introduced:
            self._adopt(slot)
        keep_all = self._lossless and attachment is not None and attachment.lossless
        depth = self._small_depth if len(sample.payload) <= SMALL else self._depth
        if self._waiting.get(slot, 0) >= (_RESERVE if keep_all else depth):
            self._drop(self._oldest(slot))
        while self._queue and self._bytes + len(sample.payload) > _BUDGET:
            self._drop(0)
        self._queue.append(_Waiting(slot, arrival))
        self._waiting[slot] = self._waiting.get(slot, 0) + 1
        self._bytes += len(sample.payload)

    def _oldest(self, slot: tuple[str, int | None]) -> int:
        """Return which waiting message of a slot goes first: a flood must not push out what may not be lost."""
        oldest: int | None = None
        for i, waiting in enumerate(self._queue):
            if waiting.slot == slot:
                attachment = waiting.arrival.attachment
                if attachment is None or not attachment.lossless:
                    return i
                oldest = i if oldest is None else oldest
        assert oldest is not None, "only a slot that holds messages is asked for"
        return oldest

    def _adopt(self, slot: tuple[str, int | None]) -> None:
        """Give a sender that is known just now what it sent as a stranger."""
        topic, epoch = slot
        for i, waiting in enumerate(self._queue):
            attachment = waiting.arrival.attachment
            if attachment and waiting.slot == (topic, None) and attachment.epoch == epoch:
                self._queue[i] = waiting._replace(slot=slot)
                self._waiting[waiting.slot] -= 1
                self._waiting[slot] = self._waiting.get(slot, 0) + 1

    def _take(self, index: int) -> _Waiting:
        taken = self._queue[index]
        del self._queue[index]
        self._waiting[taken.slot] -= 1
        if not self._waiting[taken.slot]:
            del self._waiting[taken.slot]
        self._bytes -= len(taken.arrival.sample.payload)
        return taken

    def _drop(self, index: int) -> None:
        topic, epoch = self._take(index).slot
        if epoch is not None:
            self.counters[topic].dropped += 1
