"""Reads an MCAP file from its beginning and yields every message that is whole, however the file ends.

The `mcap` package parses the records. Beyond what its readers do, a length that points past the end of the file
counts as damage, a damaged chunk is passed over, and of a chunk that is cut the messages before the cut are given.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from lz4 import frame as lz4  # type: ignore[import-untyped]  # has no types
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Header, Metadata, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary

from odom.errors import RecordingError

MAGIC = b"\x89MCAP0\r\n"

_RECORD_HEADER = 9
_MAX_CHUNK = 1 << 30
"""Bytes that a chunk may say to have when unpacked; a larger one counts as damaged. Writers make some MB. Smaller:
sound files of other writers are refused; larger: a damaged length may take the memory."""


@dataclass
class McapFile:
    """An MCAP file and what was read of it so far.

    `complete` says that the file ends as it should, `damage` lists in words what is wrong with it.
    """

    path: Path
    header: Header | None = None
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    complete: bool = False
    damage: list[str] = field(default_factory=list)

    def messages(self, not_before: int = 0) -> Iterator[tuple[Channel, McapMessage]]:
        """Yield the messages in the order of the file; chunks that end before `not_before` (log time, ns) are skipped.

        Raises RecordingError when the file cannot be opened or is no MCAP file at all.
        """
        try:
            file = self.path.open("rb")
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be opened: {error.strerror}") from error
        with file:
            begin = file.read(len(MAGIC))
            if begin != MAGIC:
                if MAGIC.startswith(begin) and begin:
                    self.damage.append(f"cut after {len(begin)} bytes: nothing is left")
                    return
                raise RecordingError(f"{self.path} is not an MCAP file")
            if not self._read_channels_of_index():
                not_before = 0  # a skipped chunk could have announced a channel
            yield from self._records(file, self.path.stat().st_size, not_before)

    def summary(self) -> Summary | None:
        """Return the file's index, None when it has none or an unsound one (cut, damaged)."""
        try:
            with self.path.open("rb") as file:
                return SeekingReader(file).get_summary()
        except _MALFORMED:
            return None

    def _read_channels_of_index(self) -> bool:
        summary = self.summary()
        if summary is None:
            return False
        self.schemas.update(summary.schemas)
        self.channels.update(summary.channels)
        return bool(summary.channels)

    def _records(self, file: BinaryIO, size: int, not_before: int) -> Iterator[tuple[Channel, McapMessage]]:
        finished = False
        while True:
            offset = file.tell()
            head = file.read(_RECORD_HEADER)
            if finished and head.startswith(MAGIC):
                self.complete = not self.damage
                return
            opcode, length = (head[0], int.from_bytes(head[1:], "little")) if len(head) == _RECORD_HEADER else (0, 0)
            if opcode == 0 or length > size - file.tell():
                what = "only its closing mark is missing" if finished else "its index and what came later are missing"
                self.damage.append(f"cut at byte {size} (last whole record ends at {offset}): {what}")
                if opcode == Opcode.CHUNK:
                    yield from self._cut_chunk(file.read())
                return
            after = file.tell() + length
            try:
                if opcode == Opcode.CHUNK:
                    yield from self._chunk(file, length, not_before)
                elif opcode == Opcode.FOOTER:
                    finished = True
                elif opcode in (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.METADATA):
                    yield from self._record(opcode, file.read(length))
            except _MALFORMED as error:
                self.damage.append(f"record at byte {offset} is damaged: {error}")
            file.seek(after)

    def _chunk(self, file: BinaryIO, length: int, not_before: int) -> Iterator[tuple[Channel, McapMessage]]:
        times = file.read(16)
        if int.from_bytes(times[8:], "little") < not_before:
            return
        chunk = Chunk.read(ReadDataStream(BytesIO(times + file.read(length - 16))))
        if chunk.uncompressed_size > _MAX_CHUNK:
            raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes")
        if chunk.compression not in ("", "zstd", "lz4"):
            raise ValueError(f"compression {chunk.compression!r} is not known")
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        yield from self._inside(stream.read(size))

    def _cut_chunk(self, body: bytes) -> Iterator[tuple[Channel, McapMessage]]:
        """Yield the messages of a chunk that the end of the file has cut."""
        try:
            chunk = Chunk.read(ReadDataStream(BytesIO(body)))
            data = chunk.data
            if chunk.compression == "zstd":
                data = zstandard.ZstdDecompressor().decompressobj().decompress(data)
            elif chunk.compression == "lz4":
                data = lz4.LZ4FrameDecompressor().decompress(data, max_length=_MAX_CHUNK)
            yield from self._inside(data)
        except _MALFORMED:
            return

    def _inside(self, data: bytes) -> Iterator[tuple[Channel, McapMessage]]:
        """Yield the messages of an unpacked chunk, up to the first record that is not whole."""
        at = 0
        while at + _RECORD_HEADER <= len(data):
            opcode, length = data[at], int.from_bytes(data[at + 1 : at + _RECORD_HEADER], "little")
            at += _RECORD_HEADER
            if length > len(data) - at:
                return
            yield from self._record(opcode, data[at : at + length])
            at += length

    def _record(self, opcode: int, body: bytes) -> Iterator[tuple[Channel, McapMessage]]:
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.MESSAGE:
            message = McapMessage.read(stream, len(body))
            channel = self.channels.get(message.channel_id)
            if channel is None:
                raise ValueError(f"a message of channel {message.channel_id}, which was not announced")
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


# what parsing arbitrary bytes raises in `mcap`, struct, zstandard and lz4
_MALFORMED = (Exception,)
