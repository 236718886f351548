"""Reads a ROS 2 bag folder (`metadata.yaml` beside .mcap or .db3 files) like a single recording."""

import re
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from odom.errors import RecordingError, WireError
from odom.frame import Stamp
from odom.wire.codec import stamp_of
from odom.wire.message import Message
from odom.wire.recording.reader import RecordingReader


class BagReader(RecordingReader):
    """Reads the folder `path`: its .mcap files one after the other, even cut ones, or its .db3 files.

    Raises RecordingError when it holds neither or they cannot be read.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._parts = [RecordingReader(part) for part in sorted(path.glob("*.mcap"), key=_number)]
        if not self._parts and not any(path.glob("*.db3")):
            raise RecordingError(f"{path} is no ROS 2 bag: neither .mcap nor .db3 files are in it")

    def counts(self) -> Counter[str] | None:
        """Return the number of messages by topic, None when a part has no sound index."""
        totals = Counter[str]()
        if not self._parts:
            with self._database() as bag:
                for connection in bag.connections:
                    totals[connection.topic.removeprefix("/")] += connection.msgcount
        for part in self._parts:
            counts = part.counts()
            if counts is None:
                return None
            totals.update(counts)
        return totals

    def _in_file_order(self, topics: Collection[str] | None, start: Stamp | None) -> Iterator[Message]:
        if not self._parts:
            yield from self._from_database(topics, start)
            return
        self.damage, self.complete, self.skipped = (), True, 0
        for part in self._parts:
            yield from part._in_file_order(topics, start)
            self.damage += tuple(f"{part.path.name}: {what}" for what in part.damage)
            self.complete &= part.complete
            self.skipped += part.skipped

    def _from_database(self, topics: Collection[str] | None, start: Stamp | None) -> Iterator[Message]:
        self.complete, self.skipped = False, 0
        with self._database() as bag:
            wanted = [c for c in bag.connections if topics is None or c.topic.removeprefix("/") in topics]
            for connection, time, payload in bag.messages(connections=wanted) if wanted else ():
                try:
                    stamp = stamp_of(connection.msgtype, payload)
                except WireError:
                    self.skipped += 1
                    continue
                at = Stamp(time) if stamp is None else stamp
                if start is None or at >= start:
                    yield Message(connection.topic.removeprefix("/"), connection.msgtype, at, bytes(payload))
        self.complete = True

    @contextmanager
    def _database(self) -> Iterator[Any]:
        """Open the database; whatever goes wrong with it, now or while it is read, becomes a RecordingError."""
        from rosbags.rosbag2 import Reader

        try:
            with Reader(self.path) as bag:
                yield bag
        except Exception as error:  # what rosbags, YAML, zstd and the database raise for arbitrary bytes
            raise RecordingError(f"{self.path} is no ROS 2 bag that can be read: {error}") from error


def _number(part: Path) -> tuple[int, str]:
    """Return a sort key that puts `bag_10` behind `bag_9`."""
    digits = re.search(r"\d+\Z", part.stem)
    return (int(digits[0]) if digits else 0, part.name)
