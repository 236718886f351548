"""Walks an MCAP file from its beginning and gives every message that is whole, however the file ends.

The records are parsed by the `mcap` package; this walk adds that no length is believed beyond the end of the file,
that a chunk which is damaged is passed over, and that of a chunk which is cut the messages before the cut are given.
"""

import zlib
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
from mcap.records import Channel, Chunk, Header, Message, Metadata, Schema
from mcap.summary import Summary

from odom.errors import RecordingError

MAGIC = b"\x89MCAP0\r\n"

_RECORD_HEADER = 9
_MAX_CHUNK = 1 << 30


@dataclass
class Scan:
    """State of a walk: what was seen so far, and what was wrong.

    `complete` says that the file ends as it should, `damage` lists in words what does not.
    """

    path: Path
    header: Header | None = None
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    complete: bool = False
    damage: list[str] = field(default_factory=list)

    def messages(self, not_before: int = 0) -> Iterator[tuple[Channel, Message]]:
        """Yield the messages in the order of the file; chunks that end before `not_before` (log time) are skipped.

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
            if not self._know_channels():
                not_before = 0  # a skipped chunk could have announced a channel
            yield from self._records(file, self.path.stat().st_size, not_before)

    def summary(self) -> Summary | None:
        """Return the file's index, None when it has none or an unsound one (cut, damaged)."""
        try:
            with self.path.open("rb") as file:
                return SeekingReader(file).get_summary()
        except _MALFORMED:
            return None

    def _know_channels(self) -> bool:
        summary = self.summary()
        if summary is None:
            return False
        self.schemas.update(summary.schemas)
        self.channels.update(summary.channels)
        return bool(summary.channels)

    def _records(self, file: BinaryIO, size: int, not_before: int) -> Iterator[tuple[Channel, Message]]:
        finished = False
        while True:
            offset = file.tell()
            head = file.read(_RECORD_HEADER)
            if finished and head.startswith(MAGIC):
                self.complete = not self.damage
                return
            opcode, length = (head[0], int.from_bytes(head[1:], "little")) if len(head) == _RECORD_HEADER else (0, 0)
            if opcode == 0 or length > size - file.tell():
                self._cut(offset, size, finished)
                if opcode == Opcode.CHUNK:
                    yield from self._rest_of_chunk(file.read())
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

    def _chunk(self, file: BinaryIO, length: int, not_before: int) -> Iterator[tuple[Channel, Message]]:
        times = file.read(16)
        if int.from_bytes(times[8:], "little") < not_before:
            return
        chunk = Chunk.read(ReadDataStream(BytesIO(times + file.read(length - 16))))
        if chunk.uncompressed_size > _MAX_CHUNK:
            raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes")
        data = _decompress(chunk.compression, chunk.data, chunk.uncompressed_size)
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise ValueError("its checksum is wrong")
        yield from self._inside(data)

    def _rest_of_chunk(self, body: bytes) -> Iterator[tuple[Channel, Message]]:
        """Yield the messages of a chunk that the end of the file has cut."""
        try:
            chunk = Chunk.read(ReadDataStream(BytesIO(body)))
            yield from self._inside(_decompress_cut(chunk.compression, chunk.data))
        except _MALFORMED:
            return

    def _inside(self, data: bytes) -> Iterator[tuple[Channel, Message]]:
        at = 0
        while at + _RECORD_HEADER <= len(data):
            opcode, length = data[at], int.from_bytes(data[at + 1 : at + _RECORD_HEADER], "little")
            at += _RECORD_HEADER
            if length > len(data) - at:
                return
            yield from self._record(opcode, data[at : at + length])
            at += length

    def _record(self, opcode: int, body: bytes) -> Iterator[tuple[Channel, Message]]:
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.MESSAGE:
            message = Message.read(stream, len(body))
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

    def _cut(self, offset: int, size: int, finished: bool) -> None:
        what = "only its closing mark is missing" if finished else "its index and what came later are missing"
        self.damage.append(f"cut at byte {size} (last whole record ends at {offset}): {what}")


# what parsing arbitrary bytes raises in `mcap`, struct, zstandard and lz4
_MALFORMED = (Exception,)


def _decompress(compression: str, data: bytes, size: int) -> bytes:
    if compression == "zstd":
        return bytes(zstandard.ZstdDecompressor().decompress(data, max_output_size=size))
    if compression == "lz4":
        return bytes(lz4.decompress(data))
    if compression:
        raise ValueError(f"compression {compression!r} is not known")
    return data


def _decompress_cut(compression: str, data: bytes) -> bytes:
    if compression == "zstd":
        return bytes(zstandard.ZstdDecompressor().decompressobj().decompress(data))
    if compression == "lz4":
        return bytes(lz4.LZ4FrameDecompressor().decompress(data, max_length=_MAX_CHUNK))
    return b"" if compression else data
