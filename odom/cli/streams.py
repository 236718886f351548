"""Standard output and error that may lose their reader: work goes on when nobody reads the log any more."""

import errno
import io
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


def outlive_readers() -> None:
    """Let a log that is closed, full or no longer read cost nothing but the log.

    Standard output, which carries results, forgives only that its reader has gone (`odom ... | head`, a terminal that
    was closed): a full disk below it is still an error.
    """
    for expected in range(3):
        try:
            os.fstat(expected)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number, that of the closed stream
    sys.stdout = _stream(1, sys.stdout, (errno.EPIPE, errno.EIO) if os.isatty(1) else (errno.EPIPE,))
    sys.stderr = _stream(2, sys.stderr, None)


def open_stream(descriptor: int) -> TextIO:
    """Return a stream to a descriptor for a log, that forgives every error."""
    return _stream(descriptor, None, None)


def _stream(descriptor: int, before: TextIO | None, forgiven: tuple[int, ...] | None) -> TextIO:
    raw = _Patient(descriptor, forgiven)
    if before is None:
        return io.TextIOWrapper(io.BufferedWriter(raw), "utf-8", "backslashreplace", line_buffering=True)
    before.flush()
    lines = isinstance(before, io.TextIOWrapper) and before.line_buffering
    return io.TextIOWrapper(io.BufferedWriter(raw), before.encoding, before.errors, line_buffering=lines)


class _Patient(io.FileIO):
    """Writes to a descriptor; the first error turns it to /dev/null, and is raised unless forgiven (None: any is)."""

    def __init__(self, descriptor: int, forgiven: tuple[int, ...] | None) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._forgiven = forgiven

    def write(self, data: "ReadableBuffer", /) -> int:
        size = memoryview(data).nbytes
        try:
            written: int | None = super().write(data)
        except OSError as error:
            with Path(os.devnull).open("wb") as null:
                os.dup2(null.fileno(), self.fileno())
            if self._forgiven is not None and error.errno not in self._forgiven:
                raise
            return size
        return size if written is None else written
