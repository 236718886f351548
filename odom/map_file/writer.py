"""Changes of a map on their way to disk: written by a thread, each time all or nothing, tried again when it fails."""

import logging
import sqlite3
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from odom.backend.map.pose_graph import Edge
from odom.backend.map.saved import MapChanges, SavedDetails, SavedKeyframe
from odom.errors import MapError, OdomError
from odom.frontend.camera.sensor_memory import SensorMemory
from odom.geometry.arrays import Array
from odom.map_file import records
from odom.map_file.counts import Counts
from odom.map_file.database import connect, transaction

_LOG = logging.getLogger(__name__)
_RETRY_S = 1.0
"""Pause before a write that failed is tried again, seconds: longer, a full disk that has room again is seen later."""
_MOST_DETAILS = 500
"""Key frames that may wait for a full disk, some .3 MB each; beyond, what the oldest measured is lost."""


@dataclass
class _Waiting:
    keyframes: dict[int, SavedKeyframe] = field(default_factory=dict)
    edges: dict[tuple[int, int], Edge] = field(default_factory=dict)
    details: dict[int, SavedDetails] = field(default_factory=dict)
    poses: dict[int, Array] = field(default_factory=dict)
    next_identity: int = 1
    sensor: SensorMemory | None = None

    def add(self, changes: MapChanges) -> None:
        self.keyframes |= {k.number: k for k in changes.keyframes}
        self.poses |= changes.poses
        for keyframe in changes.keyframes:
            self.poses.pop(keyframe.number, None)
        self.edges |= {(min(e.a, e.b), max(e.a, e.b)): e for e in changes.edges}
        for number, newer in changes.details.items():
            older = self.details.get(number, newer)
            self.details[number] = replace(newer, place=older.place if newer.place is None else newer.place)
        self.next_identity = max(self.next_identity, changes.next_identity)
        self.sensor = changes.sensor or self.sensor

    def changes(self) -> MapChanges:
        keyframes, edges = tuple(self.keyframes.values()), tuple(self.edges.values())
        return MapChanges(keyframes, edges, self.details, self.next_identity, self.sensor, self.poses)

    def __len__(self) -> int:
        return len(self.keyframes) + len(self.edges) + len(self.details) + len(self.poses)


class MapWriter:
    """Writes changes to the map at `path`, which says that it holds `counts`."""

    def __init__(self, path: Path, counts: Counts) -> None:
        self._is_failed = False
        self._lost = 0
        self._path, self._counts = path, counts
        self._db = connect(path, is_written=True)
        self._coming = _Waiting()
        self._writing = _Waiting()
        self._condition = threading.Condition()
        self._ends = False
        self._tried = 0
        self._thread = threading.Thread(target=self._work, name="odom-map-writer", daemon=True)
        self._thread.start()

    def put(self, changes: MapChanges) -> None:
        """Take over changes, which are written soon."""
        with self._condition:
            self._coming.add(changes)
            surplus = list(self._coming.details)[:-_MOST_DETAILS]
            for number in surplus:
                del self._coming.details[number]
            self._lost += len(surplus)
            self._condition.notify_all()
        if surplus:
            _LOG.error("%s: what %d key frames measured is lost: the disk has had no room", self._path, len(surplus))

    @property
    def unwritten(self) -> int:
        """Changes that wait since writing failed, and those that could not wait any longer: 0 when all is on disk."""
        with self._condition:
            return self._lost + (len(self._coming) + len(self._writing) if self._is_failed else 0)

    def waiting(self, number: int) -> SavedDetails | None:
        """Return what a key frame measured, if that is not on disk yet."""
        with self._condition:
            return self._coming.details.get(number) or self._writing.details.get(number)

    def flush(self) -> None:
        """Wait until all is written, or was tried and failed."""
        with self._condition:
            tried = self._tried
            self._condition.notify_all()
            self._condition.wait_for(lambda: not (self._coming or self._writing) or self._tried > tried + 1)

    def close(self) -> None:
        """Write what waits, as far as there is room, and end."""
        with self._condition:
            self._ends = True
            self._condition.notify_all()
        self._thread.join()
        self._db.close()

    def _work(self) -> None:
        is_last = False
        while True:
            with self._condition:
                if self._is_failed and not self._ends:
                    self._condition.wait(_RETRY_S)
                self._condition.wait_for(lambda: self._ends or self._coming)
                if not self._coming or is_last:
                    return
                is_last = self._ends
                self._writing, self._coming = self._coming, _Waiting()
            is_written = self._try_to_write(self._writing.changes())
            with self._condition:
                self._is_failed = not is_written
                is_last = is_last and self._is_failed
                if self._is_failed:
                    newer, self._coming = self._coming, self._writing
                    self._coming.add(newer.changes())
                self._writing = _Waiting()
                self._tried += 1
                self._condition.notify_all()

    def _try_to_write(self, changes: MapChanges) -> bool:
        counts = replace(self._counts, next_identity=max(self._counts.next_identity, changes.next_identity))
        try:
            write(self._db, counts, changes)
        except (sqlite3.Error, OdomError, OSError) as error:
            if not self._is_failed:
                _LOG.error("%s cannot be written (tried again until there is room): %s", self._path, error)
            return False
        if self._is_failed:
            _LOG.warning("%s is written again, with what had to wait", self._path)
        self._counts = counts
        return True


def write(db: sqlite3.Connection, counts: Counts, changes: MapChanges) -> None:
    """Write changes in one transaction; raises sqlite3.Error, and has then written nothing.

    How many key frames and registrations there are by then is counted in `counts`.
    """
    keyframes = [(k.number, records.keyframe_bytes(k)) for k in changes.keyframes]
    edges = [(min(e.a, e.b), max(e.a, e.b), records.edge_bytes(e)) for e in changes.edges]
    details = [(n, records.details_bytes(n, one)) for n, one in changes.details.items()]
    places = [(n, records.place_bytes(n, one.place)) for n, one in changes.details.items() if one.place is not None]
    with transaction(db):
        db.executemany("REPLACE INTO keyframe VALUES (?, ?)", keyframes)
        db.executemany("UPDATE keyframe SET content = ? WHERE number = ?", _carried(db, changes.poses))
        db.executemany("REPLACE INTO edge VALUES (?, ?, ?)", edges)
        db.executemany("REPLACE INTO details VALUES (?, ?)", details)
        db.executemany("REPLACE INTO place VALUES (?, ?)", places)
        held = [db.execute(f"SELECT count(*) FROM {table}").fetchone()[0] for table in ("keyframe", "edge")]
        meta = {"counts": replace(counts, keyframes=held[0], edges=held[1]).to_bytes()}
        meta |= {} if changes.sensor is None else {"sensor": records.sensor_bytes(changes.sensor)}
        db.executemany("REPLACE INTO meta VALUES (?, ?)", meta.items())


def _carried(db: sqlite3.Connection, poses: Mapping[int, Array]) -> Iterator[tuple[bytes, int]]:
    """Yield the rows of key frames at their new poses; what is not there, or is damaged, stays as it is."""
    for number, T_camera_map in poses.items():
        row = db.execute("SELECT content FROM keyframe WHERE number = ?", (number,)).fetchone()
        try:
            yield records.at_pose(row[0] if row else b"", T_camera_map), number
        except MapError:
            continue
