"""A new map file made of key frames of others: written under a temporary name, and renamed when it is whole."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from odom.backend.map.saved import MapChanges, SavedDetails, SavedKeyframe, SavedMap
from odom.errors import ConfigError
from odom.frontend.features.place_descriptor import Place
from odom.map_file import index
from odom.map_file.counts import Counts
from odom.map_file.database import connect, damaged, is_there, raising_map_errors, transaction
from odom.map_file.map_file import MapFile
from odom.map_file.sessions import Session
from odom.map_file.writer import write

_AT_ONCE = 100
"""Key frames in a transaction, all in memory at once: some 40 MB."""


@dataclass(frozen=True, eq=False)
class Origin:
    """Where a key frame comes from: its `number` in an opened map; `shift` is added to identities of landmarks."""

    opened: MapFile
    number: int
    shift: int = 0


@dataclass(frozen=True, eq=False)
class Gathered:
    """Details of key frames under new numbers, 0 to n - 1, by their `origins` (see `Details`).

    Where something cannot be read, MapError is raised, unless `is_rest`: then the rest is saved.
    """

    origins: Sequence[Origin]
    is_rest: bool = False

    def expect(self, numbers: Iterable[int]) -> None:
        """Read nothing ahead: each is fetched once, in order."""

    def fetch(self, number: int) -> SavedDetails | None:
        """Return the details of a key frame, its place among them."""
        origin = self.origins[number]
        found = origin.opened.fetch(origin.number)
        self._refuse_loss(origin)
        if found is None:
            return None
        own = replace(found.landmarks, identity=found.landmarks.identity + origin.shift)
        identities = found.identities + origin.shift * (found.identities > 0)  # 0 names none: it was culled at once
        return replace(found, identities=identities, landmarks=own, place=self.fetch_place(number))

    def fetch_place(self, number: int) -> Place | None:
        """Return the place alone, None where the key frame has none."""
        origin = self.origins[number]
        place = origin.opened.fetch_place(origin.number)
        self._refuse_loss(origin)
        return place

    def _refuse_loss(self, origin: Origin) -> None:
        if origin.opened.lost and not self.is_rest:
            raise damaged(origin.opened.path, f"key frame {origin.number} cannot be read")


def renumbered(keyframe: SavedKeyframe, new: Mapping[int, int]) -> SavedKeyframe:
    """Return a key frame whose number and links are `new` ones; links with others than these are dropped."""
    number = new[keyframe.number]
    links = tuple(new[n] for n in keyframe.links if n in new)
    return replace(keyframe, number=number, first=new.get(keyframe.first, number), links=links)


def refuse_to_replace(path: Path) -> None:
    """Raise ConfigError where there is a file already."""
    if is_there(path):
        raise ConfigError(f"{path} is there already: give the name of a new file")


def write_new(path: Path, sessions: Sequence[Session], saved: SavedMap) -> None:
    """Write a map to a new file; the same values give the same bytes.

    Raises ConfigError where there is a file already, MapError where something cannot be read or the disk is full; then
    nothing is left behind.
    """
    refuse_to_replace(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{path.name}-", dir=path.parent) as folder:
            growing = Path(folder) / "new.map"
            with raising_map_errors(path):
                _fill(growing, sessions, saved)
            refuse_to_replace(path)
            growing.rename(path)
    except OSError as error:
        raise ConfigError(f"{path} cannot be written: {error.strerror}; give another name") from error


def _fill(path: Path, sessions: Sequence[Session], saved: SavedMap) -> None:
    db = connect(path, is_written=True)
    try:
        with transaction(db):
            db.executemany("INSERT INTO session VALUES (?, ?)", [(s.number, s.to_bytes()) for s in sessions])
        write(db, Counts(next_identity=saved.next_identity), MapChanges(edges=saved.edges, sensor=saved.sensor))
        for first in range(0, len(saved.keyframes), _AT_ONCE):
            some = saved.keyframes[first : first + _AT_ONCE]
            details = {k.number: found for k in some if (found := saved.details.fetch(k.number)) is not None}
            write(db, Counts(next_identity=saved.next_identity), MapChanges(some, (), details))
        index.extend(db)
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        db.execute("PRAGMA journal_mode = DELETE")
    finally:
        db.close()
