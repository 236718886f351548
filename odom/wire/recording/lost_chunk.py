"""A chunk of an MCAP file that cannot be read, in words."""

import struct
from collections import Counter
from dataclasses import dataclass, field

from mcap.records import Channel

from odom.wire.recording.mcap_chunk import ChunkHead
from odom.wire.recording.mcap_walk import INDEX_ENTRY

_COUNTED = struct.Struct("<HI")
COUNTED_BYTES = _COUNTED.size
"""Beginning of a message index, channel and bytes of its entries, and how long it is."""


@dataclass
class LostChunk:
    """A chunk that cannot be read, and what it held according to the message index behind it."""

    offset: int
    head: ChunkHead | None
    why: str
    counts: Counter[int] = field(default_factory=Counter)

    def add(self, body: bytes) -> None:
        """Take the beginning of a message index."""
        if len(body) == _COUNTED.size:
            channel, entries = _COUNTED.unpack(body)
            self.counts[channel] += entries // INDEX_ENTRY

    def in_words(self, channels: dict[int, Channel]) -> str:
        """Return in words what is missing."""
        parts = [
            f"{count} of {channels[channel].topic if channel in channels else f'channel {channel}'}"
            for channel, count in sorted(self.counts.items())
        ]
        what = ", ".join(parts) or "its messages"
        when = ""
        if self.head is not None and self.head.start_ns <= self.head.end_ns:
            when = f" from {self.head.start_ns * 1e-9:.3f} to {self.head.end_ns * 1e-9:.3f} s"
        return f"chunk at byte {self.offset} is damaged ({self.why}); missing: {what}{when}"
