"""The folder of a run: a name that is free, and a lock so that no two write into it."""

import fcntl
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from odom.errors import ConfigError, OdomError

_LOG = logging.getLogger(__name__)
_LOCK = ".written-by"
"""File in the folder that holds the number of the process that writes there, and its lock."""
HELD_ENVIRONMENT = "ODOM_FOLDER_HELD"
"""Descriptor of the lock that a child inherits: `odom run` and its odometry hold one together."""


def new_folder(wanted: Path) -> Path:
    """Make and return the folder `wanted` or, if it is there already, the first free one of `wanted-2`, `wanted-3`.

    Two processes that ask at the same time get two folders. Raises ConfigError when it cannot be made.
    """
    name, numbers = wanted, count(2)
    while True:
        try:
            name.mkdir(parents=True)
            return name
        except FileExistsError:
            name = wanted.with_name(f"{wanted.name}-{next(numbers)}")
        except OSError as error:
            raise ConfigError(f"{name} cannot be made: {error.strerror}; give another --out") from error


@contextmanager
def held(folder: Path) -> Iterator[int]:
    """Make the folder and hold it until the end; yields the descriptor of the lock, for a child that writes there too.

    The system releases the lock when the last process that holds it has ended, however it ended. Raises ConfigError
    naming the process that holds it, or when the folder cannot be made or written; at the end OdomError, in place of
    what failed for it, when the folder is gone.
    """
    inherited = os.environ.pop(HELD_ENVIRONMENT, None)
    path = folder / _LOCK
    try:
        folder.mkdir(parents=True, exist_ok=True)
        is_inherited = inherited is not None and os.path.samestat(os.fstat(int(inherited)), path.stat())
        descriptor = int(inherited) if inherited is not None and is_inherited else _locked(path)
    except OSError as error:
        raise ConfigError(f"{folder} cannot be written: {error.strerror}; give another --out") from error
    try:
        yield descriptor
        _check_there(folder)
    except (OdomError, OSError):
        _check_there(folder)
        raise
    finally:
        if not is_inherited:
            path.unlink(missing_ok=True)
            os.close(descriptor)


def _check_there(folder: Path) -> None:
    if not folder.is_dir():
        raise OdomError(f"{folder} is gone, with all that was written there: let nothing remove it, and run it again")


def _locked(path: Path) -> int:
    """Return the descriptor of the file `path`, locked; the one that was locked may have been removed meanwhile."""
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(descriptor, 20).decode(errors="replace").strip() or "unknown"
            os.close(descriptor)
            raise ConfigError(
                f"{path.parent} is being written by process {holder}: let it end, or give another --out"
            ) from None
        except OSError as error:
            _LOG.warning("%s cannot be locked (%s): let no other run write there", path.parent, error.strerror)
        if path.exists() and os.path.samestat(os.fstat(descriptor), path.stat()):
            with suppress(OSError):  # a full disk: the lock holds all the same
                os.truncate(descriptor, 0)
                os.write(descriptor, f"{os.getpid()}\n".encode())
            return descriptor
        os.close(descriptor)
