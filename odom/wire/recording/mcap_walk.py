"""Goes through the records of an MCAP file, and finds them again where one is damaged.

Where the file has an index, every chunk is read at the place given there. Without one, a record that no writer makes
starts a search for the next chunk, from the end of the last certain one.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from mcap.opcode import Opcode

from odom.wire.recording.mcap_chunk import RECORD_HEADER, is_chunk, next_chunk, readings
from odom.wire.recording.mcap_index import MAGIC, ChunkPlace, McapIndex

_PRIVATE = 0x80
"""Opcodes from here on are other programs' own, and are passed over."""
_KNOWN = frozenset(int(opcode) for opcode in Opcode)
INDEX_ENTRY = 16
"""Bytes of a message's entry in the index behind its chunk: log time and place."""


@dataclass(frozen=True)
class McapRecord:
    """A record of the file, and the length of its body, at which the file stands.

    `end`, `end_ns` (last log time) and `channels` (none: not known) are a chunk's by the index. `wrong` says what is
    damaged, `cut` that the file ends here and too early.
    """

    offset: int
    opcode: int
    length: int
    end: int | None = None
    end_ns: int | None = None
    wrong: str = ""
    cut: str = ""
    channels: frozenset[int] = frozenset()


def walk(file: BinaryIO, size: int, index: McapIndex | None) -> Iterator[McapRecord]:
    """Yield the records of a file of `size` bytes in their order, the last with `cut` when the file ends too early."""
    places = index.places() if index else iter(())
    place = next(places, None)
    offset = sure = len(MAGIC)
    before, finished, closed = 0, False, _ends_with_mark(file, size - len(MAGIC))
    while True:
        while place is not None and place.offset < offset:
            place = next(places, None)
        opcode, length = _head(file, offset)
        if place is not None and place.offset == offset:
            is_whole = (opcode, offset + RECORD_HEADER + length) == (Opcode.CHUNK, place.end)
            wrong = "" if is_whole else "its opcode or length is not that of the index"
            length = place.end - offset - RECORD_HEADER
            yield McapRecord(offset, Opcode.CHUNK, length, place.end, place.end_ns, wrong, channels=place.channels)
            before, offset, sure = Opcode.CHUNK, place.end, place.end
            continue
        if finished and _ends_with_mark(file, offset):
            return
        end = offset + RECORD_HEADER + length
        limit = _limit(index, place, offset, size)
        fits = end <= limit and (opcode in _KNOWN or opcode >= _PRIVATE)
        if before in (Opcode.CHUNK, Opcode.MESSAGE_INDEX) and fits and _is_message_index(file, offset, length):
            opcode = Opcode.MESSAGE_INDEX
        elif (found := _chunk_end(file, offset, size, opcode)) is not None and found <= limit:
            is_whole = (opcode, end) == (Opcode.CHUNK, found)
            yield McapRecord(
                offset, Opcode.CHUNK, length, wrong="" if is_whole else "its opcode or length is wrong, it is a chunk"
            )
            before, offset, sure = Opcode.CHUNK, found, found
            continue
        elif not fits:
            found = limit if limit < size else next_chunk(file, max(sure, len(MAGIC)), size)
            if found is None:
                yield _last(offset, opcode, size, finished, closed)
                return
            yield McapRecord(offset, 0, 0, wrong=f"its opcode or length is wrong, and it was read on at byte {found}")
            before, offset = 0, found
            continue
        file.seek(offset + RECORD_HEADER)
        if opcode == Opcode.FOOTER:
            finished = True
            is_damaged = closed and index is None and any(file.read(8))
            yield McapRecord(offset, opcode, length, wrong="the index before it is damaged" if is_damaged else "")
        else:
            yield McapRecord(offset, opcode, length)
        before, offset = opcode, end


def _head(file: BinaryIO, offset: int) -> tuple[int, int]:
    """Return opcode and length of the record at `offset`, zeros at the end of the file."""
    file.seek(offset)
    head = file.read(RECORD_HEADER)
    return (head[0], int.from_bytes(head[1:], "little")) if len(head) == RECORD_HEADER else (0, 0)


def _limit(index: McapIndex | None, place: ChunkPlace | None, offset: int, size: int) -> int:
    """Return where a record at `offset` must end: at the next chunk or the index itself, when these are known."""
    if place is not None:
        return place.offset
    return index.begin if index is not None and index.chunks and offset < index.begin else size


def _chunk_end(file: BinaryIO, offset: int, size: int, opcode: int) -> int | None:
    """Return where the chunk at `offset` ends, None when none is there or its end cannot be told.

    If its two sizes disagree, the one after which a record begins is right.
    """
    if is_chunk(file, offset, size):
        return next(head.end for head in readings(file, offset, size) if head.sure)
    if opcode != Opcode.CHUNK:
        return None
    for head in readings(file, offset, size):
        following, length = _head(file, head.end)
        if following in _KNOWN and head.end + RECORD_HEADER + length <= size:
            return head.end
    return None


def _is_message_index(file: BinaryIO, offset: int, length: int) -> bool:
    """Return whether the record's body is that of an index behind a chunk, whatever its opcode is."""
    file.seek(offset + RECORD_HEADER)
    entries = int.from_bytes(file.read(6)[2:], "little")
    return length == 6 + entries and entries % INDEX_ENTRY == 0


def _ends_with_mark(file: BinaryIO, offset: int) -> bool:
    file.seek(max(0, offset))
    return file.read(len(MAGIC)) == MAGIC


def _last(offset: int, opcode: int, size: int, finished: bool, closed: bool) -> McapRecord:
    """Return the record behind which nothing more is found."""
    if closed:
        what = f"damaged from byte {offset} to its end at byte {size}: no chunk is found there"
    else:
        lost = "only its closing mark is missing" if finished else "its index and what came later are missing"
        what = f"cut at byte {size} (last whole record ends at {offset}): {lost}"
    return McapRecord(offset, opcode, 0, cut=what)
