"""The receiving side of a session: one bounded queue, with what was lost, dropped or malformed counted by key."""

import ctypes
import threading
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import NamedTuple, Self

import zenoh

from odom.errors import WireError
from odom.wire.delivery import Attachment, Delivery, attachment_of, delivery_of
from odom.wire.malformed import Malformed

SMALL = 4096

_RESERVE = 256
_BUDGET = 128 << 20
_MAX_KNOWN, _MAX_NEW = 256, 4096
_PLAUSIBLE_GAP = 1000
_thread = threading.local()


class _Arrival(NamedTuple):
    slot: tuple[str, int | None]
    attachment: Attachment | None
    sample: zenoh.Sample


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


def _keep_thread_state() -> None:
    """Keep the interpreter's state of one of Zenoh's threads, which else is made and freed around each message.

    Making and freeing it maps and unmaps memory: three times the work of a small message, and it halts the other cores.
    """
    if not hasattr(_thread, "state"):
        _thread.state = ctypes.pythonapi.PyGILState_Ensure()  # never released: the thread lives as long as the process


class Subscriber:
    """Messages of several keys in the order in which they arrived, in one bounded queue.

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
        self._queue: deque[_Arrival] = deque()
        self._waiting: dict[tuple[str, int | None], int] = {}
        self._bytes = 0
        self._senders = _Senders()
        self._ready = threading.Condition()
        self._closed = False
        handler = zenoh.handlers.Callback(self._arrive, indirect=False)
        try:
            self._subscribers = [session.declare_subscriber(key, handler) for key in keys]
        except zenoh.ZError as error:
            raise WireError(f"cannot subscribe to {', '.join(keys)}: {error}") from error

    def receive(self, timeout: float | None = None) -> Delivery | None:
        """Return the next message, None when none came within `timeout` seconds (None: wait) or after `close`.

        A message that is malformed is counted and passed over; whoever finds out later adds it to `malformed`.
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
                (topic, _), attachment, sample = self._take(0)
            try:
                delivery = delivery_of(topic, attachment, sample)
            except WireError as error:
                self.malformed.add(topic, str(error))
                continue
            self.counters[topic].bytes += len(delivery.message.payload)
            return delivery

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
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh gives no type
        self._subscribers = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _arrive(self, sample: zenoh.Sample) -> None:
        _keep_thread_state()
        topic = str(sample.key_expr)
        attachment = attachment_of(sample)
        if attachment is None and self.malformed.add_if_flooded(topic):
            return
        keep_all = self._lossless and attachment is not None and attachment.lossless
        with self._ready:
            if self._closed:
                return
            if topic not in self.counters and len(self.counters) >= self._most_counters:
                return  # a flood of invented keys must not fill the memory
            counters = self.counters.setdefault(topic, Counters())
            counters.received += 1
            epoch, missing, introduced = self._senders.take(topic, attachment)
            counters.lost += missing
            slot = (topic, epoch)
            if introduced:
                self._adopt(slot)
            depth = self._small_depth if len(sample.payload) <= SMALL else self._depth
            if self._waiting.get(slot, 0) >= (_RESERVE if keep_all else depth):
                self._drop(self._oldest(slot))
            while self._queue and self._bytes + len(sample.payload) > _BUDGET:
                self._drop(0)
            self._queue.append(_Arrival(slot, attachment, sample))
            self._waiting[slot] = self._waiting.get(slot, 0) + 1
            self._bytes += len(sample.payload)
            self._ready.notify()

    def _oldest(self, slot: tuple[str, int | None]) -> int:
        """Return which waiting message of a slot goes first: a flood must not push out what may not be lost."""
        oldest: int | None = None
        for i, arrival in enumerate(self._queue):
            if arrival.slot == slot:
                if arrival.attachment is None or not arrival.attachment.lossless:
                    return i
                oldest = i if oldest is None else oldest
        assert oldest is not None, "only a slot that holds messages is asked for"
        return oldest

    def _adopt(self, slot: tuple[str, int | None]) -> None:
        """Give a sender that is known just now what it sent as a stranger."""
        for i, arrival in enumerate(self._queue):
            if arrival.attachment and arrival.slot == (slot[0], None) and arrival.attachment.epoch == slot[1]:
                self._queue[i] = arrival._replace(slot=slot)
                self._waiting[arrival.slot] -= 1
                self._waiting[slot] = self._waiting.get(slot, 0) + 1

    def _take(self, index: int) -> _Arrival:
        arrival = self._queue[index]
        del self._queue[index]
        self._waiting[arrival.slot] -= 1
        if not self._waiting[arrival.slot]:
            del self._waiting[arrival.slot]
        self._bytes -= len(arrival.sample.payload)
        return arrival

    def _drop(self, index: int) -> None:
        topic, epoch = self._take(index).slot
        if epoch is not None:
            self.counters[topic].dropped += 1
