"""Reads the messages of an MCAP recording in the order of their capture stamps, whole or cut."""

import heapq
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from mcap.records import Channel
from mcap.records import Message as McapMessage

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import stamp_of
from odom.wire.message import Message
from odom.wire.pairing import LEAP_NS, follows
from odom.wire.recording.image_kind import can_be_decoded
from odom.wire.recording.mcap_file import CDR, McapFile

_REORDERED = 48
"""Messages that are sorted by stamp at a time, half a second of a rig. Larger: more memory (1.5 MB an image); smaller:
messages that were recorded later than that are given out of order. Chosen by hand."""
_MOST_TRIED = 10
"""Messages of a topic that are decoded at most until one is whole. Fewer: a driver that begins with bad ones is
refused; more: a recording that cannot be used takes longer to say so. Chosen by hand."""
_MOST_TOLD = 5
"""Topics of which it is told at most why messages are skipped, so that it can be read."""
_ZSTD = b"\x28\xb5\x2f\xfd"
"""How what zstd has compressed begins (RFC 8878, 3.1.1); CDR begins with a zero."""
_MARGIN_NS = 1_000_000_000
"""How much the time between a message's stamp and its recording may vary, in nanoseconds, where chunks are skipped.
Smaller: late messages may be missed when reading begins in the middle; larger: more is read in vain."""


@dataclass
class RecordedStream:
    """What a recording holds of one topic: messages, bytes, first and last stamp, the first message.

    `first` is the first of the first ten that can be decoded: some drivers begin with an empty or cut one. `steady` is
    the first stamp that another follows within a second, None without one: the pairing refuses others.
    """

    topic: str
    type_name: str
    first: Message
    begin: Stamp
    end: Stamp
    count: int = 0
    bytes: int = 0
    steady: Stamp | None = None
    _last: Stamp | None = None
    _is_first_whole: bool = False

    def add(self, message: Message) -> None:
        """Take the next message of the topic."""
        if self._last is not None and follows(message.stamp, self._last):
            self.steady = self._last if self.steady is None else min(self.steady, self._last)
        self._last = message.stamp
        if not self._is_first_whole and self.count < _MOST_TRIED and can_be_decoded(message):
            self.first, self._is_first_whole = message, True
        self.count += 1
        self.bytes += len(message.payload)
        self.begin, self.end = min(self.begin, message.stamp), max(self.end, message.stamp)

    @property
    def rate(self) -> float:
        """Messages a second between the first and the last stamp, 0 when these are the same."""
        return (self.count - 1) * 1e9 / (self.end - self.begin) if self.end > self.begin else 0.0


class RecordingReader:
    """Reads `path`; raises RecordingError when it cannot be opened or is no MCAP file of ROS 2 messages.

    Each reading sets `damage` (what is wrong with the file, in words), `complete` (whether it ends as it should),
    `skipped` (by topic how many messages are not CDR, and why the first) and `metadata`; `messages` sets `behind` too
    (messages given after those of another topic that are later by more than a second: the file lies topic after topic,
    and its log times hide it).
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage: tuple[str, ...] = ()
        self.complete = False
        self.skipped: dict[str, tuple[int, str]] = {}
        self.behind = 0
        self.metadata: dict[str, str] = {}
        self._least_lead: int | None = None

    def messages(self, topics: Collection[str] | None = None, start: Stamp | None = None) -> Iterator[Message]:
        """Yield the messages of `topics` (all: None) from `start` on, sorted by stamp.

        A message is moved before at most 48 earlier recorded ones, but not before those from before the clock was set
        back; messages of one stamp keep their order.
        """
        latest, last_of = 0, dict[str, Stamp]()
        self.behind = 0
        for message in self._nearly_sorted(topics, start):
            if message.stamp < last_of.get(message.topic, 0) - LEAP_NS:
                latest = message.stamp  # the clock was set back
            self.behind += message.stamp < latest - LEAP_NS
            latest, last_of[message.topic] = max(latest, message.stamp), message.stamp
            yield message

    def _nearly_sorted(self, topics: Collection[str] | None, start: Stamp | None) -> Iterator[Message]:
        heap: list[tuple[Stamp, int, Message]] = []
        last_of = dict[str, Stamp]()
        for index, message in enumerate(self._in_file_order(topics, start)):
            if message.stamp < last_of.get(message.topic, 0) - LEAP_NS:  # the clock was set back
                while heap:
                    yield heapq.heappop(heap)[2]
            last_of[message.topic] = message.stamp
            heapq.heappush(heap, (message.stamp, index, message))
            if len(heap) > _REORDERED:
                yield heapq.heappop(heap)[2]
        while heap:
            yield heapq.heappop(heap)[2]

    def streams(self, limit: int | None = None, counts: Mapping[str, int] | None = None) -> list[RecordedStream]:
        """Return what the recording holds, by topic, after reading all of it or `limit` bytes of its messages.

        Of topics that begin behind these and have messages by `counts`, the first messages are looked up.
        """
        streams: dict[tuple[str, str], RecordedStream] = {}
        size = 0
        for message in self._in_file_order(None, None):
            if limit is not None and size >= limit:
                break
            size += len(message.payload)
            _take(message, streams)
        seen = {topic for topic, _ in streams}
        later = [topic for topic, count in (counts or {}).items() if count and topic not in seen]
        for topic in later if limit is not None and size >= limit else ():
            for message in islice(self._in_file_order({topic}, None), _MOST_TRIED):
                _take(message, streams)
        return sorted(streams.values(), key=lambda stream: stream.topic)

    def counts(self) -> Counter[str] | None:
        """Return the number of messages by topic from the file's index, None when it has none (cut, damaged)."""
        return McapFile(self.path).counts()

    def skipped_in_words(self) -> list[str]:
        """Return a line for each of some topics with messages that are not CDR: how many, why, what to convert."""
        return [f"{n} messages of /{topic} are skipped: {why}" for topic, (n, why) in self.skipped.items()][:_MOST_TOLD]

    def _skip(self, topic: str, why: str, count: int = 1) -> None:
        before, why = self.skipped.get(topic, (0, why))
        self.skipped[topic] = before + count, why

    def _in_file_order(self, topics: Collection[str] | None, start: Stamp | None) -> Iterator[Message]:
        file = McapFile(self.path)
        self.skipped = {}
        # chunks can be skipped by log time only; an earlier reading has shown how far that is from the stamps
        lead = self._least_lead
        not_before = 0 if start is None or lead is None else max(0, start + lead - _MARGIN_NS)
        try:
            for channel, raw in file.messages(not_before, topics):
                topic = channel.topic.removeprefix("/")
                if topics is not None and topic not in topics:
                    continue
                try:
                    message = _message_of(file, topic, channel, raw)
                except WireError as error:
                    self._skip(topic, str(error))
                    continue
                if start is None or message.stamp >= start:
                    lead = raw.log_time - message.stamp
                    self._least_lead = lead if self._least_lead is None else min(lead, self._least_lead)
                    yield message
        finally:
            self.damage, self.complete = tuple(file.damage), file.complete
            self.metadata = {key: value for entry in file.metadata for key, value in entry.metadata.items()}


def _take(message: Message, streams: dict[tuple[str, str], RecordedStream]) -> None:
    """Add a message to its stream, which it may begin."""
    key = (message.topic, message.type_name)
    if key not in streams:
        streams[key] = RecordedStream(*key, message, message.stamp, message.stamp)
    streams[key].add(message)


def _message_of(file: McapFile, topic: str, channel: Channel, raw: McapMessage) -> Message:
    """Return a record of the file as a message; raises WireError when it is not CDR or ends before the stamp."""
    schema, encoding = file.schemas.get(channel.schema_id), channel.message_encoding
    if encoding != CDR:
        remedy = "give the ROS 1 bag that it was made of" if encoding == "ros1" else "write them as ROS 2 messages"
        raise WireError(f"they are encoded as {encoding or 'nothing known'}, not as CDR: {remedy}")
    if schema is None:
        raise WireError("the recording does not say what type they are of")
    stamp = stamp_in(schema.name, raw.data)
    return Message(topic, schema.name, Stamp(raw.log_time) if stamp is None else stamp, raw.data)


def stamp_in(type_name: str, payload: bytes) -> Stamp | None:
    """Return the stamp in a recorded message as `stamp_of` does; raises WireError for a compressed one, too."""
    if payload[:4] == _ZSTD:
        raise WireError("each is compressed by itself: give the folder of the bag, with its metadata.yaml")
    return stamp_of(type_name, payload)
