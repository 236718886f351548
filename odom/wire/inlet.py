"""From Zenoh's threads to ours: samples wait in native channels and are fetched in bulk.

A Python callback for each sample needs the interpreter for each: where a key is flooded, Zenoh's threads then wait
for it, the link behind them fills, and what a sensor sends meanwhile is dropped on its way.
"""

import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from typing import NamedTuple

import zenoh

from odom.wire.delivery import Attachment, attachment_of
from odom.wire.malformed import Malformed

_ROOM = 256
_MANY, _PAUSE_S = 12, 0.004
_MOST = 1024
_LATE_S = 0.001


class Arrival(NamedTuple):
    """A sample with its key and, from a sender of ours, how it was counted."""

    topic: str
    attachment: Attachment | None
    sample: zenoh.Sample


class Inlet:
    """Hands over what comes on several keys, in the order in which each lossless sender sent it.

    A channel holds at most 256 samples, then the link waits. Beside it a second subscriber of the key, that remembers
    the newest sample only, is a bell: its thread sleeps until something came, then fetches from all channels; after
    many samples it pauses for 4 ms, so that a flood is fetched in bulk. `take` is called with what arrived together, by
    one thread at a time. A sample without an attachment on a flooded key (see `Malformed`) is counted there and left
    out. Raises zenoh.ZError for a key expression that is none.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Iterable[str],
        malformed: Malformed,
        take: Callable[[list[Arrival]], None],
    ) -> None:
        self._malformed = malformed
        self._take = take
        self._lock = threading.Lock()
        keys = tuple(keys)
        self._subscribers: list[zenoh.Subscriber[zenoh.handlers.Handler[zenoh.Sample]]] = []
        for key in keys:
            self._subscribers.append(session.declare_subscriber(key, zenoh.handlers.FifoChannel(_ROOM)))
        self._channels = [
            (None if "*" in key else key, subscriber.handler)
            for key, subscriber in zip(keys, self._subscribers, strict=True)
        ]
        self._threads = []
        for key in keys:
            bell = session.declare_subscriber(key, zenoh.handlers.RingChannel(1))
            self._subscribers.append(bell)
            thread = threading.Thread(target=self._listen, args=(bell.handler,), name=f"bell of {key}", daemon=True)
            self._threads.append(thread)
            thread.start()

    def fetch(self) -> int:
        """Hand over what has come; return how many samples there were."""
        with self._lock:
            arrivals, ignored = self._look()
            if arrivals:
                self._take(in_order(arrivals))
            if ignored:
                self._malformed.ignore(ignored)
            count = len(arrivals) + ignored.total()
            if count > _MANY:
                time.sleep(_PAUSE_S)
        return count

    def close(self) -> None:
        """Stop; what has not been fetched is left."""
        with self._lock:
            self._channels.clear()
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh gives no type
        self._subscribers.clear()
        for thread in self._threads:
            thread.join(timeout=2.0)

    def _listen(self, bell: "zenoh.handlers.Handler[zenoh.Sample]") -> None:
        for _ in bell:
            if not self.fetch():  # fetched by another one already, or on its way into the channel still
                time.sleep(_LATE_S)
                self.fetch()

    def _look(self) -> tuple[list[Arrival], Counter[str]]:
        """Return what has come, and how much was left out of each key.

        What a sender sent before a sample came before it, and is found at the latest by the look through the channels
        after the one that found the sample. So once a look finds nothing of a lossless sender, none of its is missing
        in between. A live sender's are as near together as they came, and beyond 1024 samples, as only a flood brings
        together, so is everything.
        """
        arrivals, ignored = list[Arrival](), Counter[str]()
        flooded = self._malformed.flooded()
        found = True
        while found and len(arrivals) < _MOST:
            found = False
            for key, channel in self._channels:
                for _ in range(_ROOM):
                    sample = channel.try_recv()
                    if sample is None:
                        break
                    topic = str(sample.key_expr) if key is None else key
                    attachment = attachment_of(sample)
                    if attachment is None and topic in flooded:
                        ignored[topic] += 1
                        continue
                    arrivals.append(Arrival(topic, attachment, sample))
                    found = found or (attachment is not None and attachment.lossless)
        return arrivals, ignored


def in_order(arrivals: list[Arrival]) -> list[Arrival]:
    """Return the arrivals with those of each sender in the order of sending, in the places of that sender's.

    Strangers' stay where they are.
    """
    places = defaultdict[int, list[int]](list)
    for place, arrival in enumerate(arrivals):
        if arrival.attachment is not None:
            places[arrival.attachment.epoch].append(place)
    ordered = list(arrivals)
    for own in places.values():
        for place, moved in zip(own, sorted(own, key=lambda i: _serial(arrivals[i])), strict=True):
            ordered[place] = arrivals[moved]
    return ordered


def _serial(arrival: Arrival) -> int:
    return -1 if arrival.attachment is None else arrival.attachment.serial
