"""Reads ROS bags like recordings of this project: folders of .mcap or .db3 files, single .db3 files, ROS 1's .bag."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

from odom.errors import RecordingError, WireError
from odom.frame import Stamp
from odom.wire.codec import cdr
from odom.wire.message import Message
from odom.wire.recording.bag_folder import bag_folder
from odom.wire.recording.plain_name import named_plainly
from odom.wire.recording.reader import RecordingReader, stamp_in

ROS1_SUFFIX = ".bag"
_URI_SIGNS = frozenset("#?%")


class BagReader(RecordingReader):
    """Reads the folder `path`: its .mcap files one after the other, even cut ones, or its .db3 files (`bag_folder`).

    `metadata.yaml` may be missing, unless they are compressed. Raises RecordingError when it holds neither or they
    cannot be read.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        bag = bag_folder(path)
        self._parts: list[RecordingReader]
        if bag.is_compressed or (bag.is_described and not bag.recordings and not _misleads_sqlite(*bag.databases)):
            self._parts = [RosbagsReader(path)]
        elif bag.recordings:
            self._parts = [RecordingReader(part) for part in bag.recordings]
        else:
            self._parts = [RosbagsReader(part) for part in bag.databases]

    def counts(self) -> Counter[str] | None:
        """Return the number of messages by topic, None when a part has no sound index."""
        totals = Counter[str]()
        for part in self._parts:
            counts = part.counts()
            if counts is None:
                return None
            totals.update(counts)
        return totals

    def _in_file_order(self, topics: Collection[str] | None, start: Stamp | None) -> Iterator[Message]:
        self.damage, self.complete, self.skipped = (), True, {}
        for part in self._parts:
            yield from part._in_file_order(topics, start)
            self.damage += tuple(f"{part.path.name}: {what}" for what in part.damage)
            self.complete &= part.complete
            for topic, (count, why) in part.skipped.items():
                self._skip(topic, why, count)


class RosbagsReader(RecordingReader):
    """Reads what `rosbags` opens: a folder with metadata.yaml, a .db3 file, or a ROS 1 bag, whose messages become CDR.

    Messages whose type ROS 2 does not define are counted in `skipped`.
    """

    def counts(self) -> Counter[str] | None:
        """Return the number of messages by topic, of a ROS 1 bag those of types that ROS 2 defines."""
        totals = Counter[str]()
        with self._opened() as bag:
            for connection in bag.connections:
                if not self._is_ros1 or connection.msgtype in cdr.typestore(connection.msgtype).types:
                    totals[connection.topic.removeprefix("/")] += connection.msgcount
        return totals

    def _in_file_order(self, topics: Collection[str] | None, start: Stamp | None) -> Iterator[Message]:
        self.complete, self.skipped = False, {}
        as_cdr: Callable[[str, bytes], bytes] = _cdr_of_ros1 if self._is_ros1 else lambda _, payload: bytes(payload)
        with self._opened() as bag:
            wanted = [c for c in bag.connections if topics is None or c.topic.removeprefix("/") in topics]
            for connection, time, raw in bag.messages(connections=wanted) if wanted else ():
                try:
                    payload = as_cdr(connection.msgtype, raw)
                    stamp = stamp_in(connection.msgtype, payload)
                except WireError as error:
                    self._skip(connection.topic.removeprefix("/"), str(error))
                    continue
                at = Stamp(time) if stamp is None else stamp
                if start is None or at >= start:
                    yield Message(connection.topic.removeprefix("/"), connection.msgtype, at, payload)
        self.complete = True

    @property
    def _is_ros1(self) -> bool:
        return self.path.suffix.lower() == ROS1_SUFFIX

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        """Open the bag; whatever goes wrong with it, now or while it is read, becomes a RecordingError."""
        from rosbags import rosbag1, rosbag2

        try:
            with (
                named_plainly(self.path, not _misleads_sqlite(*self.path.absolute().parents, self.path)) as path,
                rosbag1.Reader(path) if self._is_ros1 else rosbag2.Reader(path) as bag,
            ):
                yield bag
        except Exception as error:  # what rosbags, YAML, zstd and the database raise for arbitrary bytes
            kind = "ROS 1 bag" if self._is_ros1 else "ROS 2 bag"
            raise RecordingError(f"{self.path} is no {kind} that can be read: {error}") from error


def _cdr_of_ros1(type_name: str, raw: bytes) -> bytes:
    """Return a ROS 1 message as ROS 2's; raises WireError for types that it does not define, and malformed bytes."""
    from rosbags.convert.converter import migrate_bytes

    try:
        ros1, ros2 = _ros1(), cdr.typestore(type_name)
        return bytes(migrate_bytes(ros1, ros2, type_name, type_name, _MIGRATIONS, raw, src_is2=False, dst_is2=True))
    except Exception as error:  # the generated code meets arbitrary bytes and types
        raise WireError(f"{type_name} of ROS 1 cannot be read: {error}") from error


_TRANSFORMS = "geometry_msgs/TransformStamped[] transforms"
_MIGRATIONS: dict[str, object] = {}
"""What `rosbags` keeps between messages: how the fields of each type are moved."""


@lru_cache(maxsize=1)
def _ros1() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(_TRANSFORMS, cdr.TRANSFORMS))  # which `rosbags` does not count as ROS 1's own
    return store


def _misleads_sqlite(*files: Path) -> bool:
    """Return whether a name holds what has a meaning in a URI, as which rosbags gives it to SQLite unchanged."""
    return any(not _URI_SIGNS.isdisjoint(file.name) for file in files)
