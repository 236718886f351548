"""Writes wire messages into an MCAP file as ROS 2 would: profile ros2, CDR, chunked, indexed, with checksums."""

import logging
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.writer import CompressionType, Writer

from odom.errors import RecordingError
from odom.frame import Stamp
from odom.wire.codec import schema
from odom.wire.message import Message
from odom.wire.recording.part_file import PartFile, how_to_save
from odom.wire.settings import Compression

_LOG = logging.getLogger(__name__)

LIBRARY = "rgbd-odom"
_CHUNK_BYTES = 8 << 20
"""Size at which a chunk is written, so large that its age ends it first. Smaller: more chunks, each of which keeps some
kilobyte of index in memory until the end; larger: writing it stalls (16 MiB: 100 ms, measured)."""
_CHUNK_AGE_S = 0.25
"""Age at which a chunk is written, in seconds: what a crash can cost. Smaller: a larger index (at 0.25 s an hour takes
some 15 MB) and worse compression."""
_COMPRESSION: Mapping[Compression, CompressionType] = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}


class RecordingWriter:
    """Writes to `part`, which becomes `path` when it is closed; a crash loses at most a quarter of a second.

    A message is logged at its stamp, not at the time of writing: a recording of a replay equals the recording. Raises
    RecordingError when the file cannot be written; an existing one is replaced only with `overwrite`, and by a whole
    one that holds messages. With `beside` the next free name is used, `take-2.mcap` beside `take.mcap`; `path` says
    which. At the end of a `with` that fails, the part stays as it is.
    """

    def __init__(
        self,
        path: Path,
        compression: Compression = "zstd",
        overwrite: bool = False,
        metadata: Mapping[str, str] | None = None,
        beside: bool = False,
    ) -> None:
        self.count = 0
        self._file = PartFile(path, overwrite, beside)
        self.path, self.part = self._file.target, self._file.path
        self._writer = Writer(self._file.file, chunk_size=_CHUNK_BYTES, compression=_COMPRESSION[compression])
        self._channels: dict[tuple[str, str], tuple[int, Iterator[int]]] = {}
        self._schemas: dict[str, int] = {}
        self._chunk_began: float | None = None
        self._closed = False
        self._writer.start(profile="ros2", library=LIBRARY)
        if metadata:
            self._writer.add_metadata(LIBRARY, dict(metadata))
        self._file.file.flush()

    def write(self, message: Message, at: Stamp | None = None) -> None:
        """Append a message, logged at its stamp or at `at`; raises RecordingError when the disk is full or gone."""
        with self._on_disk():
            channel, sequence = self._channels.get((message.topic, message.type_name)) or self._register(message)
            logged = max(0, message.stamp if at is None else at)
            self._writer.add_message(channel, logged, message.payload, logged, next(sequence))
        self.count += 1
        if self._chunk_began is None:
            self._chunk_began = time.monotonic()
        self.flush_if_due()

    def flush_if_due(self) -> None:
        """Write the chunk in progress once it is a quarter of a second old; call this when idle.

        Raises RecordingError when the disk is full or gone.
        """
        if self._chunk_began is not None and time.monotonic() - self._chunk_began >= _CHUNK_AGE_S:
            self._chunk_began = None
            with self._on_disk():
                self._writer.flush()  # type: ignore[no-untyped-call]  # mcap gives no type

    @contextmanager
    def _on_disk(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be written any more: {error.strerror}") from error

    def close(self) -> None:
        """Write the index and give the file its name; safe to call twice."""
        if self._closed:
            return
        self._closed = True
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]  # mcap gives no type
            if not self.count and self.path.exists():
                self._file.drop()
                _LOG.warning("%s stays as it was: no message came", self.path)
            else:
                self._file.keep()
        except OSError as error:
            saved = how_to_save(self.part)
            raise RecordingError(f"{self.path} cannot be finished: {error.strerror}; {saved}") from error

    def drop(self) -> None:
        """Remove what was written, which is of no use; a recording of this name stays as it was."""
        self._closed = True
        self._file.drop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if error is None:
            self.close()
        elif not self._closed:
            self._closed = True
            self._leave()

    def _leave(self) -> None:
        """Leave what was written beside the recording's name, unless it is nothing."""
        if not self.count:
            self._file.drop()
            return
        with suppress(OSError):
            self._writer.finish()  # type: ignore[no-untyped-call]  # mcap gives no type
        self._file.leave()

    def _register(self, message: Message) -> tuple[int, Iterator[int]]:
        """Return the channel of a topic and type, with its sequence numbers."""
        type_name = message.type_name
        if type_name not in self._schemas:
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", schema(type_name))
        channel = self._writer.register_channel(f"/{message.topic}", "cdr", self._schemas[type_name])
        return self._channels.setdefault((message.topic, type_name), (channel, count()))
