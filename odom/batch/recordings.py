"""The recordings of a batch, by name, and the hash of their content."""

import hashlib
import json
import logging
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from odom.errors import ConfigError, SourceError
from odom.service.result_files import write_json
from odom.wire.recording import is_recording
from sensors.folder_layouts import is_image_folder
from sensors.image_names import visible

log = logging.getLogger(__name__)

_HASHES = "hashes.json"
_DIGEST_BYTES = 16
"""Of every hash here: 128 bits, so that no two recordings ever share one."""


@dataclass(frozen=True)
class Recording:
    """A file or folder that `odom run` takes for a SOURCE, under the `name` that it has in the table."""

    name: str
    path: Path


def find_recordings(paths: Iterable[Path]) -> tuple[Recording, ...]:
    """Return the recordings among `paths` and in folders among them, however deep, sorted by name.

    A recording is an .mcap file, a ROS bag (see `is_recording`) or a folder of images (TUM's or of another data set).
    Its name is the way to it from the folder that was given, or that of the file. Raises SourceError for what is not
    there or holds none, ConfigError for two of one name.
    """
    found: dict[str, Recording] = {}
    for given in paths:
        if not given.exists():
            raise SourceError(f"{given}: no such file or folder")
        inside = sorted(_below(given))
        if not inside:
            raise SourceError(f"{given} holds no recording: an .mcap file, a ROS bag or a folder of images")
        for path in inside:
            name = path.name if path == given else path.relative_to(given).as_posix()
            recording = Recording(name.removesuffix(".mcap"), path.resolve())
            if found.setdefault(recording.name, recording) != recording:
                raise ConfigError(f"two recordings are called {recording.name}: give the folder that holds both")
    return tuple(found[name] for name in sorted(found))


def _below(path: Path, above: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Yield the recordings at a path and below, without links to nowhere or to a folder `above`, which are logged."""
    if not path.exists() or path.resolve() in above:
        log.warning("%s is left out: it is a link that leads %s", path, "in a circle" if path.exists() else "nowhere")
    elif is_image_folder(path) or (is_recording(path) and not _holds_others(path)):
        yield path
    elif path.is_dir():
        for child in visible(path):
            yield from _below(child, (*above, path.resolve()))


def _holds_others(path: Path) -> bool:
    """Return whether a folder of .db3 files without metadata.yaml, as parts of a bag are, holds what is no part."""
    if path.is_file() or (path / "metadata.yaml").is_file():
        return False
    return any(child.is_dir() or (is_recording(child) and child.suffix != ".db3") for child in visible(path))


class ContentHashes:
    """Hashes of recordings' contents, remembered in `folder` as long as sizes and times of change stay as they are."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / _HASHES
        try:
            content = json.loads(self._file.read_text())
        except (OSError, ValueError):
            content = {}
        self._known: dict[str, list[str]] = content if isinstance(content, dict) else {}
        self._changed = False

    def of(self, path: Path) -> str:
        """Return the hash of a file's bytes, or of the names and bytes of all files in a folder.

        Raises SourceError when a file cannot be read.
        """
        try:
            signature = _signature(path)
            known = self._known.get(str(path))
            if not isinstance(known, list) or known[:1] != [signature]:
                known = self._known[str(path)] = [signature, _digest(path)]
                self._changed = True
        except OSError as error:
            raise SourceError(f"{path} cannot be read: {error}") from error
        return known[1]

    def save(self) -> None:
        """Write what became known, without recordings that are gone."""
        if self._changed:
            write_json(self._file, {path: known for path, known in self._known.items() if Path(path).exists()})
            self._changed = False


def _files(path: Path) -> list[Path]:
    return [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.is_file())


def _signature(path: Path) -> str:
    state = hashlib.blake2b(digest_size=_DIGEST_BYTES)
    for file in _files(path):
        seen = file.stat()
        state.update(os.fsencode(f"{file.relative_to(path)}\0{seen.st_size}\0{seen.st_mtime_ns}\0"))
    return state.hexdigest()


def _digest(path: Path) -> str:
    state = hashlib.blake2b(digest_size=_DIGEST_BYTES)
    for file in _files(path):
        with file.open("rb") as stream:
            content = hashlib.file_digest(stream, lambda: hashlib.blake2b(digest_size=_DIGEST_BYTES))
        state.update(os.fsencode(f"{file.relative_to(path)}\0{content.hexdigest()}\0"))
    return state.hexdigest()
