"""Reads an MCAP file from its beginning and yields every whole message, however the file is damaged.

The `mcap` package parses the records. Unlike with its readers, damage costs only the damaged part: records are found
again by the index, or by searching the next chunk, and each loss is reported by topic and time.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema
from mcap.records import Message as McapMessage

from odom.errors import RecordingError
from odom.wire.recording.lost_chunk import COUNTED_BYTES, LostChunk
from odom.wire.recording.mcap_chunk import (
    LARGEST_BYTES,
    RECORD_HEADER,
    ChunkHead,
    DamagedChunkError,
    read_chunk,
    readings,
    records_inside,
    unpack_cut,
)
from odom.wire.recording.mcap_index import MAGIC, read_index
from odom.wire.recording.mcap_order import by_begin, in_time_order, is_by_topic, loose_in_time_order, merged
from odom.wire.recording.mcap_walk import McapRecord, walk


@dataclass
class McapFile:
    """An MCAP file and what was read of it so far.

    `complete` says that the file ends as it should, `damage` lists in words what is wrong with it and what is missing.
    """

    path: Path
    header: Header | None = None
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    complete: bool = False
    damage: list[str] = field(default_factory=list)
    _unannounced: Counter[int] = field(default_factory=Counter)

    def messages(
        self, not_before: int = 0, topics: Collection[str] | None = None
    ) -> Iterator[tuple[Channel, McapMessage]]:
        """Yield the messages in the order of the file, those of other topics too.

        Chunks are skipped that by the index end before `not_before` (log time, ns) or have none of `topics`. Those of a
        file that was written topic after topic come in the order of log time. Raises RecordingError when the file
        cannot be opened, is no MCAP file at all or is too far out of order.
        """
        with _open(self.path) as file:
            size = self.path.stat().st_size
            if not self._is_mcap(file, size):
                return
            index = read_index(file, size)
            if index is not None:
                self.schemas.update(index.schemas)
                self.channels.update(index.channels)
            wanted: frozenset[int] | None = None
            if index is None or not index.channels:
                not_before = 0  # a skipped chunk could have announced a channel
            elif topics is not None:
                wanted = index.channels_of(topics)
            read = partial(self._read, file, size, lambda record: _is_skipped(record, not_before, wanted))
            records = walk(file, size, index)
            if index is not None and is_by_topic(file, self.path, index):
                groups = by_begin(records, index)
                yield from merged(groups, read)
            elif index is not None and not index.chunks:
                yield from read(loose_in_time_order(file, records))
            else:
                yield from read(records)
            self._note_unannounced()
            self.complete = not self.damage

    def counts(self) -> Counter[str] | None:
        """Return the number of CDR messages by topic from the file's index, None when it has none (cut, damaged)."""
        with _open(self.path) as file:
            index = read_index(file, self.path.stat().st_size)
        if index is None or index.counts is None:
            return None
        totals = Counter[str]()
        for channel in (each for each in index.channels.values() if each.message_encoding == CDR):
            totals[channel.topic.removeprefix("/")] += index.counts.get(channel.id, 0)
        return totals

    def _is_mcap(self, file: BinaryIO, size: int) -> bool:
        """Look at the first mark, note what is wrong with it, and return whether anything comes behind it."""
        begin = file.read(len(MAGIC))
        if begin == MAGIC:
            return True
        if begin and MAGIC.startswith(begin):
            self.damage.append(f"cut after {len(begin)} bytes: nothing is left")
            return False
        head = file.read(RECORD_HEADER)
        length = int.from_bytes(head[1:], "little")
        begins = head[:1] == bytes([Opcode.HEADER]) and 8 <= length < size
        file.seek(max(0, size - len(MAGIC)))
        if not begins and file.read() != MAGIC:
            raise RecordingError(f"{self.path} is not an MCAP file")
        self.damage.append("its first mark is damaged")
        return True

    def _read(
        self, file: BinaryIO, size: int, is_skipped: Callable[[McapRecord], bool], records: Iterable[McapRecord]
    ) -> Iterator[tuple[Channel, McapMessage]]:
        lost: LostChunk | None = None
        for record in records:
            file.seek(record.offset + RECORD_HEADER)
            if lost is not None and record.opcode == Opcode.MESSAGE_INDEX:
                lost.add(file.read(COUNTED_BYTES))
                continue
            if lost is not None:
                self.damage.append(lost.in_words(self.channels))
                lost = None
            if record.wrong:
                self.damage.append(f"record at byte {record.offset}: {record.wrong}")
            if record.cut:
                self._note_unannounced()
                self.damage.append(record.cut)
                if record.opcode == Opcode.CHUNK:
                    yield from self._cut_chunk(file, size, readings(file, record.offset, size))
                return
            if is_skipped(record):
                continue
            if record.opcode == Opcode.CHUNK:
                heads = readings(file, record.offset, size, record.end)
                try:
                    yield from self._inside(read_chunk(file, heads))
                except DamagedChunkError as error:
                    lost = LostChunk(record.offset, heads[0] if heads else None, str(error))
            else:
                yield from self._loose(file, record)
        if lost is not None:
            self.damage.append(lost.in_words(self.channels))

    def _cut_chunk(self, file: BinaryIO, size: int, heads: list[ChunkHead]) -> Iterator[tuple[Channel, McapMessage]]:
        """Yield the messages of a chunk that the end of the file has cut, or that only seems to be."""
        try:
            yield from self._inside(read_chunk(file, [head for head in heads if head.end < size]))
        except DamagedChunkError:
            for head in heads[:1]:
                yield from self._inside(unpack_cut(file, head))

    def _loose(self, file: BinaryIO, record: McapRecord) -> Iterator[tuple[Channel, McapMessage]]:
        """Yield the message of a record that is in no chunk, if it is one."""
        if record.opcode not in _READ:
            return
        if record.length > LARGEST_BYTES:
            self.damage.append(f"record at byte {record.offset} is damaged: it says that it has {record.length} bytes")
            return
        try:
            yield from self._record(record.opcode, memoryview(file.read(record.length)))
        except _MALFORMED as error:
            self.damage.append(f"record at byte {record.offset} is damaged: {error}")

    def _inside(self, data: memoryview) -> Iterator[tuple[Channel, McapMessage]]:
        """Yield the messages of an unpacked chunk, up to the first record that is not whole."""
        for opcode, body in in_time_order(records_inside(data)):
            try:
                yield from self._record(opcode, body)
            except _MALFORMED as error:
                self.damage.append(f"a record inside a chunk cannot be read: {error}")

    def _record(self, opcode: int, body: memoryview) -> Iterator[tuple[Channel, McapMessage]]:
        if opcode not in _READ:
            return
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.MESSAGE:
            message = McapMessage.read(stream, len(body))
            channel = self.channels.get(message.channel_id)
            if channel is None:
                self._unannounced[message.channel_id] += 1
            else:
                yield channel, message
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels[channel.id] = channel
        elif opcode == Opcode.METADATA:
            self.metadata.append(Metadata.read(stream))
        elif opcode == Opcode.HEADER:
            self.header = Header.read(stream)

    def _note_unannounced(self) -> None:
        for channel, count in sorted(self._unannounced.items()):
            self.damage.append(f"{count} messages of channel {channel} cannot be named: what announced it is lost")
        self._unannounced.clear()


_READ = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.METADATA)

CDR = "cdr"
"""What a channel calls the encoding of ROS 2's messages."""

# what parsing arbitrary bytes raises in `mcap` and struct
_MALFORMED = (Exception,)


def _is_skipped(record: McapRecord, not_before: int, wanted: frozenset[int] | None) -> bool:
    """Return whether a record is a chunk that by the index ends too early or has no message of a wanted channel."""
    is_early = record.end_ns is not None and record.end_ns < not_before
    return is_early or (wanted is not None and bool(record.channels) and wanted.isdisjoint(record.channels))


def _open(path: Path) -> BinaryIO:
    """Open a file for reading; raises RecordingError when it cannot be, also for a pipe, which would block."""
    try:
        if path.exists() and not path.is_file():
            raise RecordingError(f"{path} is no regular file: a recording is read from its end too, so save it first")
        return path.open("rb")
    except OSError as error:
        raise RecordingError(f"{path} cannot be opened: {error.strerror}") from error
