"""The receiving side of a session: one bounded queue, and counts of what was lost, dropped or malformed on each key."""

import threading
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import zenoh

from odom.errors import WireError
from odom.wire.bulk_receiver import BulkReceiver, ReceivedSample
from odom.wire.delivery import Attachment, Delivery, delivery_of
from odom.wire.malformed_counter import MalformedCounter

SMALL_BYTES = 4096
"""Messages up to this size are small: poses and status are, images are not. Bytes; the size of a memory page."""

_LOSSLESS_DEPTH = 256
"""Messages of a lossless sender that may wait on a key. Its flow control keeps it at 64 in flight, so this is a bound
against one that does not keep to it; larger: such a sender takes more memory."""
_QUEUE_BYTES = 128 << 20
"""Bytes that may wait in all, some 80 raw images. Larger: a stalled reader takes more memory; smaller: a raw recording
drops images when the disk pauses."""
_EXTRA_KEYS = 256
"""Keys below wildcards that are counted, beside those asked for by name. A bound against a flood of invented keys;
smaller: a rig with many truth bodies is heard only in part."""
_KNOWN_SENDERS, _NEW_SENDERS = 256, 4096
"""Senders that are remembered, as known and as seen once. Bounds against invented senders, some 100 bytes each; the
second must be large, since a flood of them must not push out a real sender before its second message."""
_PLAUSIBLE_GAP = 1000
"""Messages that a sender's second may be ahead of its first, half a minute of images. Larger: invented numbers are
more easily taken for a sender; smaller: a real one that loses much is a stranger for longer."""


class _Queued(NamedTuple):
    slot: tuple[str, int | None]
    arrival: ReceivedSample


@dataclass
class ReceptionCounters:
    """What happened to the messages of one key: `lost` on the way, `dropped` here because newer ones came."""

    received: int = 0
    lost: int = 0
    dropped: int = 0
    bytes: int = 0


class _Senders:
    """Who sends on which key, recognised by sequence numbers that continue.

    A sender is known from its second message on. Until then, and without an attachment, it is a stranger; so a flood
    of invented senders is one stranger, not many known ones.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[str, int], int] = {}
        self._new: dict[tuple[str, int], int] = {}

    def take(self, topic: str, attachment: Attachment | None) -> tuple[int | None, int, bool]:
        """Return the sender's epoch (None: stranger), messages missing before this one, and if it became known now."""
        if attachment is None:
            return None, 0, False
        key, sequence = (topic, attachment.epoch), attachment.sequence
        expected, introduced = self._known.get(key), False
        if expected is None:
            expected, introduced = self._new.pop(key, None), True
            if expected is None or not 0 <= sequence - expected < _PLAUSIBLE_GAP:
                _with_room(self._new, _NEW_SENDERS)[key] = sequence + 1
                return None, 0, False
            _with_room(self._known, _KNOWN_SENDERS)
        self._known[key] = max(sequence + 1, expected)
        return attachment.epoch, max(0, sequence - expected), introduced


def _with_room(senders: dict[tuple[str, int], int], limit: int) -> dict[tuple[str, int], int]:
    """Remove the oldest entry of a dictionary that is full."""
    if len(senders) >= limit:
        del senders[next(iter(senders))]
    return senders


class Subscriber:
    """Messages of several keys in the order in which they arrived (see `BulkReceiver`), in one bounded queue.

    Of a live sender at most `depth` messages of each key wait (`small_depth` of small ones), and the newest win.
    With `lossless`, all messages of a lossless sender wait, since its flow control bounds them; otherwise they are
    treated as live ones. Beyond 128 MiB the oldest of all go. Strangers (see `_Senders`) crowd out only each other.
    On a flooded key (see `MalformedCounter`) messages without an attachment are not looked at for a second.
    """

    def __init__(
        self, session: zenoh.Session, keys: Iterable[str], depth: int, small_depth: int, lossless: bool
    ) -> None:
        keys = tuple(keys)
        # keys asked for by name are always counted, those below a wildcard only while there are not too many
        self.counters = {key: ReceptionCounters() for key in keys if "*" not in key}
        self._most_counters = len(self.counters) + _EXTRA_KEYS
        self.malformed = MalformedCounter()
        self._depth = depth
        self._small_depth = max(depth, small_depth)
        self._lossless = lossless
        self._queue: deque[_Queued] = deque()
        self._waiting: dict[tuple[str, int | None], int] = {}
        self._bytes = 0
        self._senders = _Senders()
        self._ready = threading.Condition()
        self._closed = False
        try:
            self._receiver = BulkReceiver(session, keys, self.malformed, self._enqueue)
        except zenoh.ZError as error:
            raise WireError(f"cannot subscribe to {', '.join(keys)}: {error}") from error

    def receive(self, timeout: float | None = None) -> Delivery | None:
        """Return the next message, None when none came within `timeout` seconds (None: wait) or after `close`.

        A malformed message is counted and passed over. A caller that finds a fault later adds it to `malformed`.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while (queued := self._next(deadline)) is not None:
            topic, attachment, sample = queued.arrival
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

    def total(self) -> ReceptionCounters:
        """Return the sums over all keys."""
        counters = [tuple(vars(counted).values()) for counted in list(self.counters.values())]
        return ReceptionCounters(*map(sum, zip(*counters, strict=True)))

    def close(self) -> None:
        """Stop; a caller who waits in `receive` gets what is queued, then None."""
        with self._ready:
            self._closed = True
            self._ready.notify_all()
        self._receiver.close()

    def _next(self, deadline: float | None) -> _Queued | None:
        queued = self._wait(None if deadline is None else max(0.0, deadline - time.monotonic()))
        if queued is None and not self._closed:
            self._receiver.fetch()  # the bell may have rung before the message was there
            queued = self._wait(0.0)
        return queued

    def _wait(self, timeout: float | None) -> _Queued | None:
        with self._ready:
            self._ready.wait_for(lambda: self._queue or self._closed, timeout)
            return self._take(0) if self._queue else None

    def _enqueue(self, arrivals: list[ReceivedSample]) -> None:
        with self._ready:
            for arrival in arrivals:
                self._add(arrival)
            self._ready.notify_all()

    def _add(self, arrival: ReceivedSample) -> None:
        topic, attachment, sample = arrival
        if topic not in self.counters and len(self.counters) >= self._most_counters:
            return  # a flood of invented keys must not fill the memory
        counters = self.counters.setdefault(topic, ReceptionCounters())
        counters.received += 1
        epoch, missing, introduced = self._senders.take(topic, attachment)
        counters.lost += missing
        slot = (topic, epoch)
        if introduced:
            self._adopt(slot)
        keep_all = self._lossless and attachment is not None and attachment.lossless
        depth = self._small_depth if len(sample.payload) <= SMALL_BYTES else self._depth
        if self._waiting.get(slot, 0) >= (_LOSSLESS_DEPTH if keep_all else depth):
            self._drop(self._oldest(slot))
        while self._queue and self._bytes + len(sample.payload) > _QUEUE_BYTES:
            self._drop(0)
        self._queue.append(_Queued(slot, arrival))
        self._waiting[slot] = self._waiting.get(slot, 0) + 1
        self._bytes += len(sample.payload)

    def _oldest(self, slot: tuple[str, int | None]) -> int:
        """Return the place of the message of a slot to drop first: the oldest live one, else the oldest."""
        oldest = -1
        for i, queued in enumerate(self._queue):
            if queued.slot == slot:
                attachment = queued.arrival.attachment
                if attachment is None or not attachment.lossless:
                    return i
                oldest = i if oldest < 0 else oldest
        return oldest

    def _adopt(self, slot: tuple[str, int | None]) -> None:
        """Move what a sender sent as a stranger into its own slot, once it is known."""
        topic, epoch = slot
        for i, queued in enumerate(self._queue):
            attachment = queued.arrival.attachment
            if attachment and queued.slot == (topic, None) and attachment.epoch == epoch:
                self._queue[i] = queued._replace(slot=slot)
                self._waiting[queued.slot] -= 1
                self._waiting[slot] = self._waiting.get(slot, 0) + 1

    def _take(self, index: int) -> _Queued:
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
