"""The hash of a recording's content: by it a recording is known again, wherever it lies."""

import hashlib
import json
import logging
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from odom.errors import OdomError, SourceError
from odom.service.result_files import write_json
from odom.service.unlogged import unlogged
from sensors.folder_layouts import is_image_folder, layout_of

log = logging.getLogger(__name__)

_HASHES = "hashes.json"
_DIGEST_BYTES = 16
"""Of every hash here: 128 bits, so that no two recordings ever share one."""

_CHUNK_BYTES = 1 << 20
"""Read at a time: a request to end is noticed between two. Larger: later, on a slow disk; smaller: more calls."""
_SAVE_PERIOD_S = 10.0
"""Between two savings of what became known: so much work is lost by a kill. Shorter: more is written."""

Files = dict[str, Path]
"""The files of a recording by their names in it."""


class ContentHashes:
    """Hashes of recordings' contents, remembered in `folder` as long as sizes and times of change stay as they are.

    `progress` is told the megabytes read so far; once `is_stopped`, nothing more is read.
    """

    def __init__(
        self,
        folder: Path,
        progress: Callable[[int], None] = lambda megabytes: None,
        is_stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        self._file = folder / _HASHES
        self._progress, self._is_stopped = progress, is_stopped
        self._read_bytes = 0
        self._save_due = time.monotonic() + _SAVE_PERIOD_S
        try:
            content = json.loads(self._file.read_text())
        except (OSError, ValueError):
            content = {}
        self._known: dict[str, list[str]] = content if isinstance(content, dict) else {}
        self._changed = False

    def of(self, path: Path) -> str:
        """Return the hash of a file's bytes, or of the names and bytes of all files in a folder.

        Folders that are linked into it count, and files elsewhere that the lists of an image folder name. Raises
        SourceError when a file cannot be read, OdomError when it was stopped.
        """
        try:
            files = _files(path)
            signature = _signature(files)
            known = self._known.get(str(path))
            if not isinstance(known, list) or known[:1] != [signature]:
                known = self._known[str(path)] = [signature, self._digest(files)]
                self._changed = True
                if time.monotonic() > self._save_due:
                    self.save()
        except OSError as error:
            raise SourceError(f"{path} cannot be read: {error}") from error
        return known[1]

    def save(self) -> None:
        """Write what became known, without recordings that are gone; where that fails, it is hashed again some day."""
        if self._changed:
            try:
                write_json(self._file, {path: known for path, known in self._known.items() if Path(path).exists()})
                self._changed = False
            except OSError as error:  # of the disk, or of another batch that writes the same file now
                log.warning("%s cannot be written: %s", self._file, error)
        self._save_due = time.monotonic() + _SAVE_PERIOD_S

    def _digest(self, files: Files) -> str:
        state = hashlib.blake2b(digest_size=_DIGEST_BYTES)
        for name, file in files.items():
            content = hashlib.blake2b(digest_size=_DIGEST_BYTES)
            with file.open("rb") as stream:
                while chunk := stream.read(_CHUNK_BYTES):
                    content.update(chunk)
                    self._read_bytes += len(chunk)
                    self._progress(self._read_bytes // 1_000_000)
                    if self._is_stopped():
                        raise OdomError("stopped while the recordings were hashed; the next call goes on from here")
            state.update(os.fsencode(f"{name}\0{content.hexdigest()}\0"))
        return state.hexdigest()


def _files(path: Path) -> Files:
    if path.is_file():
        return {".": path}
    found = {file.relative_to(path).as_posix(): file for file in _below(path)}
    return dict(sorted((_listed_elsewhere(path) | found).items()))


def _below(folder: Path, above: tuple[Path, ...] = ()) -> Iterator[Path]:
    """Yield the files in a folder and in all below it, linked ones too, except links to one of the folders `above`."""
    real = folder.resolve()
    if real in above:
        return
    for child in folder.iterdir():
        if child.is_dir():
            yield from _below(child, (*above, real))
        elif child.is_file():
            yield child


def _listed_elsewhere(folder: Path) -> Files:
    """Return the images outside a folder that its lists name; none where the lists cannot be read."""
    try:
        with unlogged():
            layout = layout_of(folder) if is_image_folder(folder) else None
    except OdomError:
        return {}
    names = {entry.values[0] for entry in (*layout.color, *layout.depth)} if layout else set[str]()
    outside = (name for name in names if Path(name).is_absolute() or ".." in Path(name).parts)
    return {name: folder / name for name in outside if (folder / name).is_file()}


def _signature(files: Files) -> str:
    state = hashlib.blake2b(digest_size=_DIGEST_BYTES)
    for name, file in files.items():
        seen = file.stat()
        state.update(os.fsencode(f"{name}\0{seen.st_size}\0{seen.st_mtime_ns}\0"))
    return state.hexdigest()
