"""A map's file, opened by one process: read when needed, and written in the background while the camera moves."""

import logging
import os
import sqlite3
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

from odom.backend.map.pose_graph import Edge
from odom.backend.map.saved import MapChanges, SavedDetails, SavedKeyframe, SavedMap
from odom.errors import MapError
from odom.frame import Camera
from odom.frontend.camera.sensor_memory import SensorMemory
from odom.frontend.features.place_descriptor import Place
from odom.map_file import index, records
from odom.map_file.counts import Counts
from odom.map_file.database import UNREADABLE, connect, damaged, lock, raising_map_errors, transaction
from odom.map_file.read_ahead import ReadAhead
from odom.map_file.sessions import Session, is_same_camera
from odom.map_file.writer import MapWriter

_LOG = logging.getLogger(__name__)


class MapFile:
    """One map on disk; with `is_written` it is made where there is none, and extended.

    An odometry goes on in it, or with `is_written` False only finds the camera in it:

        with closing(odom.MapFile("lab.map", is_written=True)) as map_file:
            odometry = odom.Odometry(camera, saved=map_file.begin(camera))
            for frame in frames:
                odometry.process(frame)
                map_file.put(odometry.take_map_changes())
            odometry.finish()
            map_file.put(odometry.take_map_changes())

    Close it after the odometry's last call: what key frames measured is read when it is needed.

    Raises ConfigError where the file is no map or does not exist, MapError where it is damaged or in use.
    """

    def __init__(self, path: str | Path, is_written: bool) -> None:
        path = Path(path)
        self.path, self.is_written = path, is_written
        self._lost: set[int] = set()
        self._lock = threading.Lock()
        self._lock_file = lock(path) if is_written else None
        self._writer: MapWriter | None = None
        self._ahead = ReadAhead(self._read)
        try:
            self._db = connect(path, is_written)
        except BaseException:
            self._unlock()
            raise

    def sessions(self) -> list[Session]:
        """Return the sessions, in order."""
        rows = self._rows("SELECT number, content FROM session ORDER BY number")
        with self._naming_file():
            return [Session.of(content) for _, content in rows]

    def keyframes(self) -> list[SavedKeyframe]:
        """Return the key frames, by number; raises MapError where one is missing or damaged."""
        rows = self._rows("SELECT number, content FROM keyframe ORDER BY number")
        with self._naming_file():
            found = [records.keyframe_of(content) for _, content in rows]
            if [k.number for k in found] != list(range(len(rows))) or len(rows) != self.counts().keyframes:
                raise MapError("key frames are missing")
        return found

    def edges(self) -> list[Edge]:
        """Return the registrations; raises MapError where one is missing or damaged."""
        rows = self._rows("SELECT a, content FROM edge ORDER BY a, b")
        with self._naming_file():
            found = records.edges_of([content for _, content in rows])
            if len(found) != self.counts().edges:
                raise MapError("registrations are missing")
        return found

    def counts(self) -> Counts:
        """Return how much the map says it holds."""
        content = self._meta("counts")
        with self._naming_file():
            return Counts() if content is None else Counts.of(content)

    def sensor(self) -> SensorMemory | None:
        """Return what the newest session has learnt of its camera, None where it did not last."""
        content = self._meta("sensor")
        with self._naming_file():
            return None if content is None else records.sensor_of(content)

    def _meta(self, name: str) -> bytes | None:
        return dict(self._rows("SELECT name, content FROM meta")).get(name)

    def digest(self) -> str:
        """Return a hash of sessions, key frames and registrations, by which maps are compared and sorted."""
        found = sha256()
        for table, order in (("session", "number"), ("keyframe", "number"), ("edge", "a, b")):
            for (content,) in self._rows(f"SELECT content FROM {table} ORDER BY {order}"):
                found.update(content)
        return found.hexdigest()

    def check_readable(self) -> int:
        """Read what is read when a session begins, and close; return how many key frames there are.

        Raises MapError where it is damaged.
        """
        try:
            self.sessions()
            self.edges()
            self.sensor()
            return len(self.keyframes())
        finally:
            self.close()

    def begin(self, camera: Camera) -> SavedMap:
        """Return the map for a new session with this camera; it is recorded if the map is written.

        Raises MapError where the map was made with another camera.
        """
        self.flush()
        sessions = self.sessions()
        for session in sessions:
            if not is_same_camera(session.camera, camera):
                raise MapError(
                    f"{self.path} was made with another camera: session {session.number} has {session.camera}, this is "
                    f"{camera}; give that camera's calibration, or make a map of its own"
                )
        keyframes, edges, counts = self.keyframes(), self.edges(), self.counts()
        made_by = [*(session.number for session in sessions), *(k.session for k in keyframes)]
        number = 1 + max(made_by, default=-1)  # a mended map may lack some
        if self.is_written:
            self._write_session(Session(number, datetime.now(UTC).isoformat(timespec="seconds"), camera))
            self._writer = self._writer or MapWriter(self.path, counts)
        blocks = index.load(self._db, self._lock, self.path)
        _LOG.info("%s: %d key frames of %d sessions", self.path, len(keyframes), len(sessions))
        identity, is_fixed, sensor = counts.next_identity, not self.is_written, self.sensor()
        return SavedMap(tuple(keyframes), tuple(edges), self, blocks, identity, number, is_fixed, sensor)

    def _write_session(self, session: Session) -> None:
        with raising_map_errors(self.path), self._lock, transaction(self._db):
            self._db.execute("INSERT INTO session VALUES (?, ?)", (session.number, session.to_bytes()))

    def expect(self, numbers: Iterable[int]) -> None:
        """Begin to read key frames that may soon be fetched."""
        self._ahead.ask(numbers)

    def fetch(self, number: int) -> SavedDetails | None:
        """Return what a key frame measured; None, counted and logged, where it cannot be read."""
        return self._ahead.get(number)

    def _read(self, number: int) -> SavedDetails | None:
        waiting = None if self._writer is None else self._writer.waiting(number)
        if waiting is not None:
            return waiting
        try:
            content = self._row("SELECT content FROM details WHERE number = ?", number)
            if content is None:
                raise MapError("it is missing")
            return records.details_of(number, content, None)
        except (MapError, *UNREADABLE) as error:
            self._count_lost(number, error)
            return None

    def fetch_place(self, number: int) -> Place | None:
        """Return the place that a key frame shows; None where it shows none or cannot be read."""
        waiting = None if self._writer is None else self._writer.waiting(number)
        if waiting is not None:
            return waiting.place
        try:
            content = self._row("SELECT content FROM place WHERE number = ?", number)
            return None if content is None else records.place_of(number, content)
        except (MapError, *UNREADABLE) as error:
            self._count_lost(number, error)
            return None

    @property
    def lost(self) -> int:
        """Key frames of which what they measured or the place they show could not be read."""
        return len(self._lost)

    def _count_lost(self, number: int, error: Exception) -> None:
        if self._ahead.is_closed:  # the background of an odometry that was not finished may still ask
            return
        if not self._lost:
            _LOG.warning("%s: key frame %d is left out (others are counted): %s", self.path, number, error)
        self._lost.add(number)

    def put(self, changes: MapChanges) -> None:
        """Take over changes; they are on disk within a second, or a failure is logged and they are tried again."""
        if self._writer is not None:
            self._writer.put(changes)
        self._ahead.forget(changes.details)  # after that: what is read ahead from now on is new

    @property
    def unwritten(self) -> int:
        """Changes that are not on disk since they could not be written: 0 once they are."""
        return 0 if self._writer is None else self._writer.unwritten

    def flush(self) -> None:
        """Wait until all changes are on disk, or could not be written."""
        if self._writer is not None:
            self._writer.flush()

    def close(self) -> None:
        """Write what waits, and leave one plain file behind; safe to call twice."""
        self._ahead.close()
        if self._writer is not None:
            self._writer.close()
            self._writer = None
        try:
            if self.is_written and self._lock_file is not None:
                with self._lock:
                    index.extend(self._db)
                    self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
                    self._db.execute("PRAGMA journal_mode = DELETE")
        except (MapError, sqlite3.DatabaseError) as error:  # a full disk, or another reader: the map is whole
            _LOG.info("%s stays in two files until it is opened again: %s", self.path, error)
        finally:
            self._db.close()
            self._unlock()

    def _unlock(self) -> None:
        if self._lock_file is not None:
            os.close(self._lock_file)
            self._lock_file = None

    @contextmanager
    def _naming_file(self) -> Iterator[None]:
        try:
            yield
        except MapError as error:
            raise damaged(self.path, str(error)) from error

    def _rows(self, query: str) -> list[Any]:
        with raising_map_errors(self.path), self._lock:
            return self._db.execute(query).fetchall()

    def _row(self, query: str, number: int) -> bytes | None:
        with self._lock:
            row = self._db.execute(query, (number,)).fetchone()
        return None if row is None else row[0]
