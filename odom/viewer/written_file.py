"""The file that a viewer writes: it replaces none that is there unless that was asked for, and is whole or told."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from odom.errors import ConfigError, OdomError


def make(path: Path, overwrite: bool) -> None:
    """Make the file, empty, with the folders above it.

    Raises ConfigError where it is there and may not be replaced, OdomError where it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.open("wb" if overwrite else "xb").close()
    except OSError as error:
        if path.exists() and not overwrite:
            raise ConfigError(f"{path} exists already: choose another name or replace it with --overwrite") from None
        raise OdomError(f"{path} cannot be written: {error}") from error


@contextmanager
def told_if_not_whole(path: Path | None) -> Iterator[None]:
    """Raise OdomError for what Rerun could not write to the file, or to those who look (None)."""
    try:
        yield
    except RuntimeError as error:
        raise OdomError(f"{path or 'what is shown'} is not complete: {error}; is the disk full?") from error
