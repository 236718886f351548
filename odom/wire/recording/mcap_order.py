"""Brings the messages of an MCAP file into the order of time where they were written topic after topic.

Many tools write all images of one topic before those of the next. The index then shows chunks that overlap in time, and
the indexes behind the chunks that each topic is in order by itself; in a file without chunks the messages themselves
do. Where a topic's own time goes back, the clock was set back: such a file stays as it was recorded.
"""

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import count
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel
from mcap.records import Message as McapMessage

from odom.errors import RecordingError
from odom.wire.recording.mcap_chunk import LARGEST_BYTES, RECORD_HEADER
from odom.wire.recording.mcap_index import ChunkPlace, McapIndex
from odom.wire.recording.mcap_walk import INDEX_ENTRY, McapRecord

_SLACK_NS = 250_000_000
"""Nanoseconds by which a message may come after a later one without the file counting as out of order: as late as
drivers deliver. Larger: short files written topic after topic are read as they lie, and images are lost; smaller: files
that are nearly in order are looked through once before they are read. Chosen by hand."""
_MOST_HELD_BYTES = 512 << 20
"""Bytes of unpacked chunks that may be held to bring them into order. Smaller: files are refused that could be read;
larger: a file takes that much memory. Topic after topic needs some MB for each topic."""

_ENTRIES_AT = 6
"""Bytes of a message index before its entries: channel, and the entries' size."""
_CHANNEL_BYTES = 2
"""Bytes of a channel's number, with which a message and a message index begin."""
_LOG_TIME = slice(6, 14)
"""Where a message's log time lies in its record: behind channel and sequence number."""

Found = tuple[Channel, McapMessage]


def is_by_topic(file: BinaryIO, path: Path, index: McapIndex) -> bool:
    """Return whether chunks overlap in time although the messages of each channel are in order.

    Raises RecordingError when more of them overlap than may be held in memory.
    """
    places = [place for place in index.places() if place.begin_ns <= place.end_ns and place.end_ns]  # not empty ones
    latest = 0
    for place in places:
        if place.begin_ns < latest - _SLACK_NS:
            break
        latest = max(latest, place.end_ns)
    else:
        return False
    if not _channels_are_in_order(file, places):
        return False
    if (held := _most_held(places)) > _MOST_HELD_BYTES:
        raise RecordingError(
            f"{path}: its messages are so far out of the order of time that {held >> 20} MB would have to be held at "
            f"once: sort it first, with: mcap sort {path} -o SORTED.mcap"
        )
    return True


def by_begin(records: Iterable[McapRecord], index: McapIndex) -> Iterator[tuple[int, list[McapRecord]]]:
    """Yield chunks, each with the records up to the next one, by the log time (ns) they begin at.

    What lies before the first chunk comes first, with 0.
    """
    begins = {place.offset: place.begin_ns for place in index.places()}
    groups: list[tuple[int, list[McapRecord]]] = [(0, [])]
    for record in records:
        if record.opcode == Opcode.CHUNK:
            groups.append((begins.get(record.offset, 0), []))
        groups[-1][1].append(record)
    yield from sorted(groups, key=lambda group: group[0])


def merged(
    groups: Iterable[tuple[int, list[McapRecord]]], read: Callable[[list[McapRecord]], Iterable[Found]]
) -> Iterator[Found]:
    """Yield what `read` finds in the groups by log time; no group is read before its time."""
    heap: list[tuple[int, int, Found]] = []
    number = count()
    for begin_ns, records in groups:
        while heap and heap[0][0] < begin_ns:
            yield heapq.heappop(heap)[2]
        for found in read(records):
            heapq.heappush(heap, (found[1].log_time, next(number), found))
    while heap:
        yield heapq.heappop(heap)[2]


def in_time_order(records: Iterable[tuple[int, memoryview]]) -> list[tuple[int, memoryview]]:
    """Return a chunk's records (opcode, body), its messages by log time if they are so within each channel."""
    found = list(records)
    return [found[k] for k in _by_time([body if opcode == Opcode.MESSAGE else None for opcode, body in found])]


def loose_in_time_order(file: BinaryIO, records: Iterable[McapRecord]) -> list[McapRecord]:
    """Return the records of a file without chunks, its messages by log time if they are so within each channel."""
    found = list(records)
    heads: list[bytes | None] = []
    for record in found:
        is_message = record.opcode == Opcode.MESSAGE
        if is_message:
            file.seek(record.offset + RECORD_HEADER)
        heads.append(file.read(_LOG_TIME.stop) if is_message else None)
    return [found[k] for k in _by_time(heads)]


def _by_time(heads: Sequence[bytes | memoryview | None]) -> Sequence[int]:
    """Return the order of records by the beginnings of messages; None, what is no message, comes first.

    It is that in which they lie where they are in order, and where a channel's own time goes back.
    """
    latest, last_of, is_sorted = 0, dict[bytes, int](), True
    for head in heads:
        if head is not None:
            time, channel = _log_time(head), bytes(head[:_CHANNEL_BYTES])
            if time < last_of.get(channel, 0):
                return range(len(heads))
            last_of[channel] = time
            is_sorted &= time >= latest
            latest = max(time, latest)
    if is_sorted:
        return range(len(heads))
    times = [-1 if head is None else _log_time(head) for head in heads]
    return sorted(range(len(heads)), key=times.__getitem__)


def _log_time(body: bytes | memoryview) -> int:
    return int.from_bytes(body[_LOG_TIME], "little")


def _channels_are_in_order(file: BinaryIO, places: Iterable[ChunkPlace]) -> bool:
    """Return whether the indexes behind the chunks show that every channel's log times rise; False without indexes."""
    last: dict[int, int] = {}
    for place in places:
        file.seek(place.end)
        while (head := file.read(RECORD_HEADER))[:1] == bytes([Opcode.MESSAGE_INDEX]):
            length = int.from_bytes(head[1:], "little")
            if length > LARGEST_BYTES:
                return False  # damaged
            body = file.read(length)
            entries = body[_ENTRIES_AT:]
            times = np.frombuffer(entries[: len(entries) // INDEX_ENTRY * INDEX_ENTRY], dtype="<u8")[::2]
            channel = int.from_bytes(body[:_CHANNEL_BYTES], "little")
            if not len(times):
                continue
            if int(times.min()) < last.get(channel, 0) - _SLACK_NS:
                return False
            last[channel] = max(last.get(channel, 0), int(times.max()))
    return bool(last)


def _most_held(places: Sequence[ChunkPlace]) -> int:
    """Return how many bytes of unpacked chunks lie over one time, at most."""
    changes = [(p.begin_ns, p.unpacked_bytes) for p in places] + [(p.end_ns + 1, -p.unpacked_bytes) for p in places]
    held = most = 0
    for _, change in sorted(changes):
        held += change
        most = max(most, held)
    return most
