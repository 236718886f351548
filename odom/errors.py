"""The one family of errors: each says what is wrong and what to do about it."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import UnionType

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""The disk is full, or what this user may have of it."""


class OdomError(Exception):
    """Root of every error this project raises on purpose; the command line prints it and exits with 1."""


class ConfigError(OdomError):
    """A setting, option or calibration that cannot be used (command line: exit status 2)."""


class InputError(OdomError, ValueError):
    """An array or value handed to an algorithm has the wrong shape, type or range."""


class SourceError(OdomError):
    """A sensor, folder or recording cannot be opened or has stopped delivering."""


class RecordingError(SourceError):
    """A recording is damaged, cut or lacks a stream that is needed."""


class WireError(OdomError):
    """A message cannot be decoded, or the Zenoh session cannot be opened."""


class DeviceError(SourceError):
    """A live device is missing, busy, forbidden or unplugged."""


class MapError(OdomError):
    """A map file is damaged, made by a newer version, of another camera, or in use."""


def check_type(
    name: str, value: object, kind: type | UnionType, instead: str, error: type[OdomError] = InputError
) -> None:
    """Raise `error` for an argument `name` that is not of this `kind`, and say what to give `instead`."""
    if not isinstance(value, kind):
        raise error(f"{type(value).__name__} given as {name}: give {instead}")


@contextmanager
def writing_to(path: Path) -> Iterator[None]:
    """Make the folder of the file `path`, which is written meanwhile; raises OdomError where either cannot be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        advice = "make room, or choose another place" if error.errno in _NO_ROOM else "choose another place"
        raise OdomError(f"{path} cannot be written: {error.strerror or error}; {advice}") from error


@contextmanager
def writing_whole(path: Path) -> Iterator[Path]:
    """Like `writing_to`, of a file that is whole or as it was before: what is written to the path given replaces it."""
    with writing_to(path), replacing(path) as part:
        yield part


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the path of a file beside `path`, which replaces that once it is written; raises OSError."""
    part = path.with_name(f"{path.name}.part")
    try:
        yield part
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
