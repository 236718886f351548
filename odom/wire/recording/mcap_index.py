"""Reads the index at the end of an MCAP file, if its checksum holds."""

import zlib
from array import array
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Schema, Statistics

from odom.wire.recording.mcap_chunk import RECORD_HEADER

MAGIC = b"\x89MCAP0\r\n"

_FOOTER_BODY = 20
"""Bytes of the footer's content, which the format prescribes."""
_LARGEST_BYTES = 256 << 20
"""Bytes of an index beyond which it counts as damaged: a day of recording makes 100 MB."""
_LARGEST_RECORD = 16 << 20
"""Bytes of a record of the index beyond which it counts as damaged."""
_NUMBERS = 5
"""Numbers that are kept of a chunk: the fields of its place."""


@dataclass(frozen=True, slots=True)
class ChunkPlace:
    """Where the index says that a chunk lies, its record from `offset` to `end`, its first and last log time (ns).

    `channels` are those of its messages, none where the index does not say.
    """

    offset: int
    end: int
    begin_ns: int
    end_ns: int
    unpacked_bytes: int
    channels: frozenset[int]


@dataclass
class McapIndex:
    """The index of a file: what is in it, how many messages each channel has, and where the `chunks` are."""

    begin: int
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] | None = None
    chunks: int = 0
    _places: "array[int]" = field(default_factory=lambda: array("Q"))
    _channels: list[frozenset[int]] = field(default_factory=list)
    _sets: dict[frozenset[int], frozenset[int]] = field(default_factory=dict)

    def add(self, place: ChunkPlace) -> None:
        """Take the place of a chunk; only its numbers, and each set of channels once, are kept, as there are many."""
        self._places.extend((place.offset, place.end, place.begin_ns, place.end_ns, place.unpacked_bytes))
        self._channels.append(self._sets.setdefault(place.channels, place.channels))
        self.chunks += 1

    def channels_of(self, topics: Collection[str]) -> frozenset[int]:
        """Return the channels of topics, which are named without their leading slash."""
        return frozenset(c.id for c in self.channels.values() if c.topic.removeprefix("/") in topics)

    def places(self) -> Iterator[ChunkPlace]:
        """Yield the places of the chunks, in the order of the file."""
        for k in sorted(range(0, _NUMBERS * self.chunks, _NUMBERS), key=self._places.__getitem__):
            offset, end, begin_ns, end_ns, unpacked = self._places[k : k + _NUMBERS]
            yield ChunkPlace(offset, end, begin_ns, end_ns, unpacked, self._channels[k // _NUMBERS])


def read_index(file: BinaryIO, size: int) -> McapIndex | None:
    """Return the index of a file of `size` bytes, None when there is none or it is cut or damaged."""
    footer_at = size - len(MAGIC) - RECORD_HEADER - _FOOTER_BODY
    if footer_at < len(MAGIC):
        return None
    file.seek(footer_at)
    raw = file.read(RECORD_HEADER + _FOOTER_BODY)
    if raw[:RECORD_HEADER] != bytes([Opcode.FOOTER]) + _FOOTER_BODY.to_bytes(8, "little"):
        return None
    footer = Footer.read(ReadDataStream(BytesIO(raw[RECORD_HEADER:])))
    begin = footer.summary_start
    if not len(MAGIC) < begin < footer_at or footer_at - begin > _LARGEST_BYTES:
        return None
    if footer.summary_crc and footer.summary_crc != _checksum(file, begin, footer_at + len(raw) - 4):
        return None
    index = McapIndex(begin)
    file.seek(begin)
    while file.tell() < footer_at:
        head = file.read(RECORD_HEADER)
        length = int.from_bytes(head[1:], "little")
        if length > min(_LARGEST_RECORD, footer_at - file.tell()):
            return None
        try:
            _add(index, head[0], file.read(length))
        except Exception:  # what parsing arbitrary bytes raises in `mcap` and struct
            return None
    return index


def _add(index: McapIndex, opcode: int, body: bytes) -> None:
    stream = ReadDataStream(BytesIO(body))
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(stream)
        index.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(stream)
        index.channels[channel.id] = channel
    elif opcode == Opcode.CHUNK_INDEX:
        chunk = ChunkIndex.read(stream)
        end = chunk.chunk_start_offset + chunk.chunk_length
        if len(MAGIC) <= chunk.chunk_start_offset < end <= index.begin:
            begin_ns, end_ns = chunk.message_start_time, chunk.message_end_time
            channels = frozenset(chunk.message_index_offsets)
            index.add(ChunkPlace(chunk.chunk_start_offset, end, begin_ns, end_ns, chunk.uncompressed_size, channels))
    elif opcode == Opcode.STATISTICS:
        index.counts = Statistics.read(stream).channel_message_counts


def _checksum(file: BinaryIO, begin: int, end: int) -> int:
    file.seek(begin)
    checksum, left = 0, end - begin
    while left > 0 and (piece := file.read(min(left, 1 << 20))):
        checksum, left = zlib.crc32(piece, checksum), left - len(piece)
    return checksum
