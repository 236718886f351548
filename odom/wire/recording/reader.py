"""Reads the messages of an MCAP recording in the order of their capture stamps, whole or cut."""

import heapq
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Channel
from mcap.records import Message as McapMessage

from odom.errors import RecordingError, WireError
from odom.frame import Stamp
from odom.wire.codec import stamp_of
from odom.wire.message import Message
from odom.wire.recording.scan import Scan

_REORDER = 48
_MARGIN_NS = 1_000_000_000


@dataclass
class Stream:
    """What a recording holds of one topic: messages, bytes, first and last stamp, the first message."""

    topic: str
    type_name: str
    first: Message
    begin: Stamp
    end: Stamp
    count: int = 0
    bytes: int = 0

    @property
    def rate(self) -> float:
        """Messages a second between the first and the last stamp, 0 when that cannot be told."""
        return (self.count - 1) * 1e9 / (self.end - self.begin) if self.end > self.begin else 0.0


class RecordingReader:
    """Reads `path`; raises RecordingError when it cannot be opened or is no MCAP file of ROS 2 messages.

    `damage` says in words what the last reading found wrong, `skipped` counts messages that are not CDR.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage: tuple[str, ...] = ()
        self.complete = False
        self.skipped = 0
        self.metadata: dict[str, str] = {}
        self._least_lead: int | None = None

    def messages(self, topics: Collection[str] | None = None, start: Stamp | None = None) -> Iterator[Message]:
        """Yield the messages of `topics` (all: None) from `start` on, sorted by stamp.

        A message is moved before at most 48 earlier recorded ones; messages of one stamp keep their order.
        """
        heap: list[tuple[Stamp, int, Message]] = []
        for index, message in enumerate(self._in_file_order(topics, start)):
            heapq.heappush(heap, (message.stamp, index, message))
            if len(heap) > _REORDER:
                yield heapq.heappop(heap)[2]
        while heap:
            yield heapq.heappop(heap)[2]

    def streams(self, limit: int | None = None) -> list[Stream]:
        """Return what the recording holds, by topic, from reading all of it or its first `limit` bytes of messages."""
        streams: dict[tuple[str, str], Stream] = {}
        size = 0
        for message in self._in_file_order(None, None):
            if limit is not None and size >= limit:
                break
            size += len(message.payload)
            key = (message.topic, message.type_name)
            stream = streams.get(key)
            if stream is None:
                stream = streams[key] = Stream(*key, message, message.stamp, message.stamp)
            stream.count += 1
            stream.bytes += len(message.payload)
            stream.begin, stream.end = min(stream.begin, message.stamp), max(stream.end, message.stamp)
        return sorted(streams.values(), key=lambda stream: stream.topic)

    def counts(self) -> dict[str, int] | None:
        """Return the number of messages a topic from the file's index, None when it has none (cut, damaged)."""
        summary = Scan(self.path).summary()
        if summary is None or summary.statistics is None:
            return None
        counts = summary.statistics.channel_message_counts
        totals: dict[str, int] = {}
        for channel in summary.channels.values():
            topic = channel.topic.removeprefix("/")
            totals[topic] = totals.get(topic, 0) + counts.get(channel.id, 0)
        return totals

    def _in_file_order(self, topics: Collection[str] | None, start: Stamp | None) -> Iterator[Message]:
        scan = Scan(self.path)
        self.skipped = 0
        # chunks are skipped by the clock of logging, which is told from the stamps by what was read before
        lead = self._least_lead
        not_before = 0 if start is None or lead is None else max(0, start + lead - _MARGIN_NS)
        try:
            for channel, raw in scan.messages(not_before):
                topic = channel.topic.removeprefix("/")
                if topics is not None and topic not in topics:
                    continue
                message = self._message(scan, topic, channel, raw)
                if message is None:
                    self.skipped += 1
                elif start is None or message.stamp >= start:
                    lead = raw.log_time - message.stamp
                    self._least_lead = lead if self._least_lead is None else min(lead, self._least_lead)
                    yield message
        finally:
            self.damage, self.complete = tuple(scan.damage), scan.complete
            self.metadata = {key: value for entry in scan.metadata for key, value in entry.metadata.items()}

    def _message(self, scan: Scan, topic: str, channel: Channel, raw: McapMessage) -> Message | None:
        schema = scan.schemas.get(channel.schema_id)
        if channel.message_encoding != "cdr" or schema is None:
            return None
        try:
            stamp = stamp_of(schema.name, raw.data)
        except WireError:
            return None
        return Message(topic, schema.name, Stamp(raw.log_time) if stamp is None else stamp, raw.data)


def recover(
    source: Path,
    target: Path,
    overwrite: bool = False,
    progress: Callable[[int], None] = lambda messages: None,
    stopped: Callable[[], bool] = lambda: False,
) -> tuple[int, tuple[str, ...]]:
    """Copy every whole message of a damaged recording into a sound one, with its own schemas and channels.

    `progress` is told how many are copied; once `stopped` says so, what is copied by then is a sound recording.
    Returns the number of messages and what was wrong. Raises RecordingError when nothing can be saved or `target`
    exists and may not be replaced.
    """
    from mcap.writer import CompressionType, Writer

    scan, count = Scan(source), 0
    if target.exists() and (not overwrite or target.samefile(source)):
        raise RecordingError(f"{target} exists already: choose another name or say that it may be replaced")
    messages = scan.messages()
    first = next(messages, None)
    if first is None:
        raise RecordingError(f"{source}: no message can be saved ({'; '.join(scan.damage) or 'there is none'})")
    try:
        with target.open("wb") as file:
            writer = Writer(file, chunk_size=1 << 20, compression=CompressionType.ZSTD)
            header = scan.header
            writer.start(profile=header.profile if header else "ros2", library=header.library if header else "")
            schemas: dict[int, int] = {}
            channels: dict[int, int] = {}
            for channel, message in _chain(first, messages):
                if channel.id not in channels:
                    schema = scan.schemas.get(channel.schema_id)
                    if schema is not None and schema.id not in schemas:
                        schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
                    channels[channel.id] = writer.register_channel(
                        channel.topic, channel.message_encoding, schemas.get(channel.schema_id, 0), channel.metadata
                    )
                writer.add_message(
                    channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
                )
                count += 1
                progress(count)
                if stopped():
                    break
            for entry in scan.metadata:
                writer.add_metadata(entry.name, entry.metadata)
            writer.finish()  # type: ignore[no-untyped-call]  # mcap gives no type
    except OSError as error:
        raise RecordingError(f"{target} cannot be written: {error.strerror}") from error
    return count, tuple(scan.damage)


def _chain(
    first: tuple[Channel, McapMessage], rest: Iterator[tuple[Channel, McapMessage]]
) -> Iterator[tuple[Channel, McapMessage]]:
    yield first
    yield from rest
