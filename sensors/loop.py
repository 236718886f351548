"""A recorded source played again and again, with stamps that go on."""

from collections.abc import Iterator

from odom.frame import Stamp
from odom.wire import Message
from odom.wire.codec import restamp
from sensors.source import Source

_GAP_NS = 33_333_333
"""Nanoseconds between the last stamp of a round and the first of the next: one frame at 30 Hz."""


class LoopedSource:
    """Plays a recorded source round after round, each shifted to begin a frame after the one before."""

    lossless = True
    length = None

    def __init__(self, source: Source) -> None:
        self._source = source
        self._closed = False

    def messages(self) -> Iterator[Message]:
        """Yield without end, until `close`; a source without messages ends at once."""
        shift = 0
        while True:
            first: Stamp | None = None
            last = Stamp(0)
            for message in self._source.messages():
                first = message.stamp if first is None else min(first, message.stamp)
                last = max(last, message.stamp)
                yield message if shift == 0 else restamp(message, Stamp(message.stamp + shift))
            if first is None or self._closed:
                return
            shift += last - first + _GAP_NS

    def close(self) -> None:
        """End `messages` at the next message."""
        self._closed = True
        self._source.close()
