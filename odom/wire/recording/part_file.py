"""The file in which a recording grows: it gets the recording's name only when it is whole."""

import logging
from contextlib import suppress
from glob import escape
from itertools import count
from pathlib import Path
from typing import BinaryIO

from odom.errors import ConfigError, RecordingError

_LOG = logging.getLogger(__name__)

PART = ".part"
"""What the name of a growing recording ends with, behind that of the recording."""


class PartFile:
    """`take.mcap.part`, which becomes `take.mcap` at the end; an existing one is replaced then, not before.

    Replacing must be allowed with `overwrite`; with `beside` the next free name is used instead, `take-2.mcap`. Of two
    recordings that begin together only one gets a given name. `target` is the recording's name, `path` that of the
    growing file, which stays when the work fails or the process is killed: `recover` makes a recording of it.

    Raises RecordingError when the name is taken or nothing can be written there.
    """

    def __init__(self, target: Path, overwrite: bool = False, beside: bool = False) -> None:
        self.target, numbers = target, count(2)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            while True:
                try:
                    self.file: BinaryIO = _create(self.target, overwrite)
                    break
                except TakenError:
                    if not beside:
                        raise
                self.target = target.with_stem(f"{target.stem}-{next(numbers)}")
        except OSError as error:
            raise RecordingError(f"{target} cannot be written: {error.strerror}") from error
        self.path = part_of(self.target)
        self._overwrite = overwrite

    def keep(self) -> None:
        """Give the file its name; raises RecordingError when that has been taken meanwhile, OSError of the disk."""
        self.file.close()
        if self.target.exists() and not self._overwrite:
            raise RecordingError(f"{self.target} was made by another program meanwhile: this recording is {self.path}")
        self.path.replace(self.target)

    def leave(self) -> None:
        """Leave the file under its growing name, and log that, also where the disk has no room for its last bytes."""
        with suppress(OSError):
            self.file.close()
        _LOG.warning("%s was not finished: %s", self.target, how_to_save(self.path))

    def drop(self) -> None:
        """Remove the file, which holds nothing."""
        with suppress(OSError):
            self.file.close()
        self.path.unlink(missing_ok=True)


def part_of(target: Path) -> Path:
    """Return the name under which the recording `target` grows."""
    return target.with_name(f"{target.name}{PART}")


def newest_part(target: Path) -> Path | None:
    """Return the growing or left file of a recording, `{time}` in its name being any time; None without one."""
    found = target.parent.glob(escape(part_of(target).name).replace("{time}", "*"))
    return max(found, key=lambda path: (path.stat().st_mtime_ns, path.name), default=None)


def how_to_save(part: Path) -> str:
    """Say what to do with the file that a recorder left."""
    return f"what was recorded is in {part}; `odom recover {part} OUT.mcap` makes a recording of it"


def check_free(target: Path, overwrite: bool) -> None:
    """Raise RecordingError when a recording of this name may not be begun."""
    if target.is_dir() or (target.exists() and not overwrite):
        raise TakenError(f"{target} exists already: choose another name or replace it with --overwrite")
    if part_of(target).exists():
        raise TakenError(
            f"{part_of(target)} is of a recorder at work, or of one that was killed: in that case "
            f"`odom recover {part_of(target)} OUT.mcap` saves it; remove it then, or choose another name"
        )


class TakenError(RecordingError, ConfigError):
    """The name of a recording is taken: the call is wrong, and nothing was touched."""


def _create(target: Path, overwrite: bool) -> BinaryIO:
    """Create the part in one step: two processes that start together get two names."""
    check_free(target, overwrite)
    try:
        file = part_of(target).open("xb")
    except FileExistsError:
        check_free(target, overwrite)
        return _create(target, overwrite)
    if target.exists() and not overwrite:  # another recorder has just finished the same recording
        file.close()
        part_of(target).unlink()
        check_free(target, overwrite)
    return file
