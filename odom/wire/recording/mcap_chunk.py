"""Finds and unpacks the chunks of an MCAP file, also where the record that holds one is damaged.

A chunk says its size twice, in the record's length and before its data, and carries a checksum of what it holds. So a
damaged opcode, length, size or name of the compression does not cost its messages: what fits the checksum is right.
"""

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import IO, Any, BinaryIO, cast

import numpy as np
import zstandard
from lz4 import frame as lz4  # type: ignore[import-untyped]  # has no types
from mcap.opcode import Opcode

RECORD_HEADER = 9
"""Bytes of a record before its body: opcode and length."""
LARGEST_BYTES = 128 << 20
"""Bytes that a chunk, unpacked, or any other record may have; a larger one counts as damaged. Writers make chunks of
some MB. Smaller: sound files of other writers are refused; larger: a damaged or malicious length takes the memory."""

_FIXED = 28
"""Bytes of a chunk's body before the name of its compression: times, unpacked size, checksum."""
_HEAD = RECORD_HEADER + _FIXED + 4 + 4 + 8
"""Bytes of a chunk's record before its data, at most: the longest name of a compression has four letters."""
_NAMES = {b"": "", b"zstd": "zstd", b"lz4": "lz4"}
_MAGICS = {b"\x28\xb5\x2f\xfd": "zstd", b"\x04\x22\x4d\x18": "lz4"}
_LARGEST_WINDOW = 64 << 20
"""Bytes of zstd's window: its highest ordinary level needs 8 MiB, a long one only takes memory."""
_PIECE = 1 << 20
"""Bytes that are unpacked at a time: more takes memory, less is slower."""
_SCAN = 4 << 20
"""Bytes that are searched for the next chunk at a time: more takes memory, less is slower."""


@dataclass(frozen=True)
class ChunkHead:
    """A record of the file read as a chunk: its log times (ns), unpacked size and checksum, and where its data lie.

    `sure` says that both of its sizes agree.
    """

    start_ns: int
    end_ns: int
    unpacked_bytes: int
    checksum: int
    compression: str
    data_at: int
    end: int
    sure: bool


class DamagedChunkError(Exception):
    """A chunk that cannot be used, and why; never leaves this package."""


def readings(file: BinaryIO, offset: int, size: int, end: int | None = None) -> list[ChunkHead]:
    """Return all ways to read the record at `offset` as a chunk, the likeliest first, whatever its opcode is.

    The file has `size` bytes; `end` is where the record ends by the index. A chunk that is cut ends with the file.
    """
    file.seek(offset)
    raw = file.read(_HEAD)
    body = raw[RECORD_HEADER:]
    if len(body) < _FIXED + 12:
        return []
    start_ns, end_ns, unpacked = struct.unpack_from("<QQQ", body)
    checksum, said = struct.unpack_from("<II", body, 24)
    ends = [offset + RECORD_HEADER + int.from_bytes(raw[1:RECORD_HEADER], "little"), *([] if end is None else [end])]
    found = []
    for length in dict.fromkeys((said, 4, 3, 0)):
        rest = body[_FIXED + 4 :]
        if length > 4 or len(rest) < length + 8:
            continue
        data_at = offset + RECORD_HEADER + _FIXED + 12 + length
        compression = _NAMES.get(rest[:length]) if length == said else None
        if compression is None:
            file.seek(data_at)
            compression = _MAGICS.get(file.read(4))
        if compression is not None:
            own = data_at + int.from_bytes(rest[length : length + 8], "little")
            for to in dict.fromkeys(min(place, size) for place in (own, *ends) if place >= data_at):
                sure = to == own and own in ends and start_ns <= end_ns
                found.append(ChunkHead(start_ns, end_ns, unpacked, checksum, compression, data_at, to, sure))
    return found


def is_chunk(file: BinaryIO, offset: int, size: int) -> bool:
    """Return whether the record at `offset` is a chunk by its two sizes, which agree, whatever its opcode is."""
    return any(head.sure for head in readings(file, offset, size))


def next_chunk(file: BinaryIO, start: int, size: int) -> int | None:
    """Return where the first chunk at or after `start` begins that is one by `is_chunk`, or None."""
    for at in range(start, size, _SCAN):
        file.seek(at)
        block = np.frombuffer(file.read(_SCAN + RECORD_HEADER - 1), dtype=np.uint8)
        begins = block[: max(0, len(block) - RECORD_HEADER + 1)]
        # an opcode, and a length below 4 GiB that ends in the file: few places remain to be looked at
        likely = begins == int(Opcode.CHUNK)
        for byte in range(5, RECORD_HEADER):
            likely = likely & (block[byte : byte + len(begins)] == 0)
        places = np.flatnonzero(likely)
        lengths = block[places[:, None] + np.arange(1, 5)] @ (1 << np.arange(0, 32, 8))
        for place in places[at + places + RECORD_HEADER + lengths <= size]:
            if is_chunk(file, at + int(place), size):
                return at + int(place)
    return None


def read_chunk(file: BinaryIO, heads: Sequence[ChunkHead]) -> memoryview:
    """Return what a chunk holds by the first reading that fits its checksum.

    Raises DamagedChunkError when none does, for the first one's reason.
    """
    errors = []
    for head in heads:
        try:
            return unpack(file, head)
        except DamagedChunkError as error:
            errors.append(error)
    raise errors[0] if errors else DamagedChunkError("its compression is not known")


def unpack(file: BinaryIO, head: ChunkHead) -> memoryview:
    """Return what a chunk holds; raises DamagedChunkError when that is too much or does not fit the checksum."""
    data, error = _unpacked(file, head)
    if head.checksum == 0 and (error or len(data) != head.unpacked_bytes):
        raise DamagedChunkError(error or f"it unpacks to {len(data)} bytes, and says {head.unpacked_bytes}")
    if head.checksum and zlib.crc32(data) != head.checksum:
        raise DamagedChunkError(error or "its checksum does not hold")
    return memoryview(data)


def unpack_cut(file: BinaryIO, head: ChunkHead) -> memoryview:
    """Return what is left of a chunk that the end of the file has cut."""
    return memoryview(_unpacked(file, head)[0])


def _unpacked(file: BinaryIO, head: ChunkHead) -> tuple[bytearray, str]:
    """Return what a chunk holds, a little more than the largest at most, and what stopped the unpacking."""
    data = bytearray()
    if head.end - head.data_at > LARGEST_BYTES:
        return data, f"it has {head.end - head.data_at} bytes, more than {LARGEST_BYTES >> 20} MiB"
    try:
        for piece in _pieces(_Part(file, head.data_at, head.end), head.compression):
            data += piece
            if len(data) > LARGEST_BYTES:
                return data, f"it unpacks to more than {LARGEST_BYTES >> 20} MiB, and says {head.unpacked_bytes} bytes"
    except Exception as error:  # what zstandard and lz4 raise for arbitrary bytes
        return data, str(error)
    return data, ""


def _pieces(packed: "_Part", compression: str) -> Iterator[bytes]:
    """Yield the unpacked bytes, little at a time, however much they become."""
    if compression == "lz4":
        lz4_frame = lz4.LZ4FrameDecompressor()
        while not lz4_frame.eof:
            more = packed.read(_PIECE) if lz4_frame.needs_input else b""
            if lz4_frame.needs_input and not more:
                return
            yield lz4_frame.decompress(more, max_length=_PIECE)
        return
    stream: Any = packed
    if compression == "zstd":
        stream = zstandard.ZstdDecompressor(max_window_size=_LARGEST_WINDOW).stream_reader(cast(IO[bytes], packed))
    while piece := stream.read(_PIECE):
        yield piece


class _Part:
    """The bytes of a file from `begin` to `end`, as a file to be read."""

    def __init__(self, file: BinaryIO, begin: int, end: int) -> None:
        self._file, self._at, self._end = file, begin, end

    def read(self, size: int) -> bytes:
        self._file.seek(self._at)
        part = self._file.read(min(size, self._end - self._at))
        self._at += len(part)
        return part


def records_inside(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Yield opcode and body of an unpacked chunk's records, up to the first that is not whole."""
    at = 0
    while at + RECORD_HEADER <= len(data):
        opcode, length = data[at], int.from_bytes(data[at + 1 : at + RECORD_HEADER], "little")
        at += RECORD_HEADER
        if length > len(data) - at:
            return
        yield opcode, data[at : at + length]
        at += length
