"""The one family of errors: each says what is wrong and what to do about it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raise OdomError naming the file or folder `path` for an OSError of what is written to it meanwhile."""
    try:
        yield
    except OSError as error:
        raise OdomError(
            f"{path} cannot be written: {error.strerror or error}; make room, or choose another place"
        ) from error
