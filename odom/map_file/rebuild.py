"""A new map file from what is whole in another one, with key frames numbered anew."""

import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from odom.backend.map.pose_graph import Edge
from odom.backend.map.saved import SavedKeyframe, SavedMap
from odom.errors import MapError
from odom.frontend.camera.sensor_memory import SensorMemory
from odom.map_file import records
from odom.map_file.counts import Counts
from odom.map_file.database import UNREADABLE
from odom.map_file.map_file import MapFile
from odom.map_file.new_map import Gathered, Origin, refuse_to_replace, renumbered, write_new
from odom.map_file.sessions import Session

_MOST_KEYFRAMES = 1_000_000
"""Numbers tried in a map that no longer says how many there are."""


@dataclass
class ReadableParts:
    """What could be read of a map, and in `damage` what could not, in words."""

    sessions: dict[int, Session] = field(default_factory=dict)
    keyframes: dict[int, SavedKeyframe] = field(default_factory=dict)
    edges: list[Edge] = field(default_factory=list)
    details: set[int] = field(default_factory=set)
    places: set[int] = field(default_factory=set)
    next_identity: int = 1
    sensor: SensorMemory | None = None
    damage: list[str] = field(default_factory=list)


def read_all_rows(db: sqlite3.Connection) -> ReadableParts:
    """Read every row of a map, and return what is whole."""
    found = ReadableParts()
    try:
        found.damage += [f"file: {text}" for (text,) in db.execute("PRAGMA integrity_check(10)") if text != "ok"]
    except UNREADABLE as error:
        found.damage.append(f"file: {error}")
    counts = _read(db, found, "meta", "name", "counts", Counts.of) or Counts()
    found.sensor = _read(db, found, "meta", "name", "sensor", records.sensor_of)
    held = max(_highest(db, "keyframe") + 1, counts.keyframes)
    for number in range(_highest(db, "session") + 1):
        if _is_in(db, "session", number) and (session := _read(db, found, "session", "number", number, Session.of)):
            found.sessions[number] = session
    found.next_identity = counts.next_identity
    for number in range(min(held, _MOST_KEYFRAMES)):
        keyframe = _read(db, found, "keyframe", "number", number, records.keyframe_of)
        if keyframe is None or keyframe.number != number:
            continue
        found.keyframes[number] = keyframe
        details = _read(db, found, "details", "number", number, lambda c, n=number: records.details_of(n, c, None))
        if details is not None:
            found.details.add(number)
            found.next_identity = max(found.next_identity, *(details.landmarks.identity + 1).tolist(), 1)
        if _is_in(db, "place", number) and _read(
            db, found, "place", "number", number, lambda c, n=number: records.place_of(n, c)
        ):
            found.places.add(number)
        found.edges += _edges(db, found, number)
    if len(found.edges) < counts.edges:
        found.damage.append(f"edge: {counts.edges - len(found.edges)} of {counts.edges} are missing")
    return found


def write_rest(opened: MapFile, found: ReadableParts, path: Path) -> int:
    """Write what was found whole to a new map; return its key frames.

    Raises ConfigError where there is one already, MapError where there is nothing to write.
    """
    refuse_to_replace(path)
    numbers = [n for n in sorted(found.keyframes) if n in found.details]
    if not numbers:
        raise MapError("no key frame is whole: nothing was written")
    new = {old: number for number, old in enumerate(numbers)}
    keyframes = tuple(renumbered(found.keyframes[old], new) for old in numbers)
    edges = tuple(replace(e, a=new[e.a], b=new[e.b]) for e in found.edges if e.a in new and e.b in new)
    details = Gathered([Origin(opened, old) for old in numbers], is_rest=True)
    rest = SavedMap(keyframes, edges, details, next_identity=found.next_identity, sensor=found.sensor)
    write_new(path, [session for _, session in sorted(found.sessions.items())], rest)
    return len(numbers)


def _read(db: sqlite3.Connection, found: ReadableParts, table: str, key: str, value: int | str, decode: Any) -> Any:
    """Return a row decoded, None where it is missing or damaged, which is noted."""
    try:
        row = db.execute(f"SELECT content FROM {table} WHERE {key} = ?", (value,)).fetchone()
        if row is not None:
            return decode(row[0])
        what = "missing"
    except (MapError, *UNREADABLE) as error:
        what = str(error)
    if table != "meta" or what != "missing":
        found.damage.append(f"{table} {value}: {what}")
    return None


def _edges(db: sqlite3.Connection, found: ReadableParts, a: int) -> Iterator[Edge]:
    try:
        for b, content in db.execute("SELECT b, content FROM edge WHERE a = ?", (a,)):
            try:
                yield from records.edges_of([content])
            except MapError as error:
                found.damage.append(f"edge {a} to {b}: {error}")
    except UNREADABLE as error:
        found.damage.append(f"edges of {a}: {error}")


def _is_in(db: sqlite3.Connection, table: str, number: int) -> bool:
    try:
        return db.execute(f"SELECT 1 FROM {table} WHERE number = ?", (number,)).fetchone() is not None
    except UNREADABLE:
        return True  # it cannot be read: reading it says why


def _highest(db: sqlite3.Connection, table: str) -> int:
    try:
        (highest,) = db.execute(f"SELECT max(number) FROM {table}").fetchone()
    except UNREADABLE:
        return -1
    return -1 if highest is None else int(highest)
