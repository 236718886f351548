"""Takes samples from Zenoh's threads: they wait in native channels and are fetched many at a time.

A Python callback for each sample would need the interpreter for each. Where a key is flooded, Zenoh's threads would
then wait for the interpreter, the link behind them would fill, and what a sensor sends meanwhile would be dropped.
"""

import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from typing import NamedTuple

import zenoh

from odom.wire.delivery import Attachment, attachment_of
from odom.wire.malformed_counter import MalformedCounter

_CHANNEL_SAMPLES = 256
"""Samples that wait in a key's channel before its link has to wait. Larger: more memory in a flood (256 images of
1.5 MB are 400 MB); smaller: a link waits while the interpreter is busy elsewhere. Chosen by hand."""
_MANY_SAMPLES = 12
"""Samples in one fetch that count as a flood, more than a rig of cameras sends in 4 ms. Larger: a flood takes more of
the interpreter's time; smaller: ordinary messages are delayed by the pause below."""
_PAUSE_S = 0.004
"""Pause after such a fetch. Longer: ordinary messages beside a flood come later; shorter: the flood takes more of the
interpreter's time. Chosen with tests/wire/test_bulk_receiver.py, which counts what a flooded key takes in."""
_MOST_SAMPLES = 1024
"""Samples after which a fetch ends even if lossless ones keep coming. Larger: a flood delays the rest; smaller: an
ordinary burst is split, and messages of a lossless sender may change order. Four full channels."""
_ENDED_S = 2.0
"""Time for all listening threads together to end, which they do at once unless the machine is busy. Longer delays the
end of the process; shorter lets threads wait beyond `close`, which find nothing more to fetch. Chosen by hand."""
_LATE_S = 0.001
"""How long to wait for a sample whose bell has rung before it is in its channel. Chosen by hand; longer only delays."""


class ReceivedSample(NamedTuple):
    """A sample with its key and its attachment, None from a foreign sender."""

    topic: str
    attachment: Attachment | None
    sample: zenoh.Sample


class BulkReceiver:
    """Hands over what comes on several keys, in the order in which each lossless sender sent it.

    A second subscriber of each key, which remembers only the newest sample, is its bell: a thread sleeps until it
    rings and then fetches from all channels. `take` is called with what arrived together, by one thread at a time.
    A sample without an attachment on a flooded key is counted in `malformed` and left out.
    Raises zenoh.ZError when a key expression is not valid.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Iterable[str],
        malformed: MalformedCounter,
        take: Callable[[list[ReceivedSample]], None],
    ) -> None:
        self._malformed = malformed
        self._take = take
        self._lock = threading.Lock()
        self._closed = False
        keys = tuple(keys)
        self._subscribers = [session.declare_subscriber(k, zenoh.handlers.FifoChannel(_CHANNEL_SAMPLES)) for k in keys]
        names = [None if "*" in key else key for key in keys]
        self._channels = list(zip(names, (subscriber.handler for subscriber in self._subscribers), strict=True))
        self._threads = list[threading.Thread]()
        for key in keys:
            bell = session.declare_subscriber(key, zenoh.handlers.RingChannel(1))
            self._subscribers.append(bell)
            thread = threading.Thread(target=self._listen, args=(bell.handler,), name=f"bell of {key}", daemon=True)
            self._threads.append(thread)
            thread.start()

    def fetch(self) -> int:
        """Hand over what has come; return how many samples there were, none after `close`."""
        with self._lock:
            arrivals, ignored = self._look()
            if arrivals:
                self._take(in_order(arrivals))
            if ignored:
                self._malformed.ignore(ignored)
            count = len(arrivals) + ignored.total()
            if count > _MANY_SAMPLES:
                time.sleep(_PAUSE_S)
        return count

    def close(self) -> None:
        """Stop; samples that have not been fetched are lost."""
        self._closed = True  # before the lock, for which a flood would let it wait
        with self._lock:
            self._channels.clear()
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh gives no type
        self._subscribers.clear()
        deadline = time.monotonic() + _ENDED_S
        for thread in self._threads:
            thread.join(timeout=max(0.0, deadline - time.monotonic()))  # it ends with its channel, at once

    def _listen(self, bell: "zenoh.handlers.Handler[zenoh.Sample]") -> None:
        for _ in bell:
            if self._closed:
                return
            if not self.fetch():  # another thread has fetched it, or it is not in the channel yet
                time.sleep(_LATE_S)
                self.fetch()

    def _look(self) -> tuple[list[ReceivedSample], Counter[str]]:
        """Return what has come, and how many samples of each key were left out.

        A sample that a lossless sender sent before another one may be found after it, but not later than in the next
        look through all channels. So the looks are repeated until one finds nothing from a lossless sender.
        """
        arrivals, ignored = list[ReceivedSample](), Counter[str]()
        flooded = self._malformed.flooded()
        found = True
        while found and len(arrivals) < _MOST_SAMPLES and not self._closed:
            found = False
            for key, channel in self._channels:
                for _ in range(_CHANNEL_SAMPLES):
                    sample = channel.try_recv()
                    if sample is None:
                        break
                    topic = str(sample.key_expr) if key is None else key
                    attachment = attachment_of(sample)
                    if attachment is None and topic in flooded:
                        ignored[topic] += 1
                        continue
                    arrivals.append(ReceivedSample(topic, attachment, sample))
                    found = found or (attachment is not None and attachment.lossless)
        return arrivals, ignored


def in_order(arrivals: list[ReceivedSample]) -> list[ReceivedSample]:
    """Return the samples with those of each sender sorted by serial number among the places that they took.

    Samples without an attachment stay where they are.
    """
    sent = defaultdict[int, list[tuple[int, int]]](list)
    for place, (_, attachment, _) in enumerate(arrivals):
        if attachment is not None:
            sent[attachment.epoch].append((attachment.serial, place))
    ordered = list(arrivals)
    for own in sent.values():
        for (_, place), (_, moved) in zip(own, sorted(own), strict=True):
            ordered[place] = arrivals[moved]
    return ordered
