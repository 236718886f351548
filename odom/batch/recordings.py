"""The recordings of a batch, by name."""

import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from odom.errors import ConfigError, SourceError
from odom.wire.recording import is_recording
from sensors.folder_layouts import is_image_folder
from sensors.image_names import visible

log = logging.getLogger(__name__)


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
