"""The SQLite file of a map: made, opened, checked for being one of ours, brought up to this version, and locked."""

import fcntl
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from odom.errors import ConfigError, MapError

VERSION = 1
"""Of the tables (`PRAGMA user_version`)."""
_APPLICATION = 0x6F646F6D
"""Says that an SQLite file is a map (`PRAGMA application_id`): odom in ASCII."""
_SQLITE = b"SQLite format 3\0"
_PAGE_BYTES = 16384
"""SQLite's page: a key frame fills several; smaller pages mean more of them to read, larger ones more to write."""
_TABLES = """
CREATE TABLE meta (name TEXT PRIMARY KEY, content BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE session (number INTEGER PRIMARY KEY, content BLOB NOT NULL);
CREATE TABLE keyframe (number INTEGER PRIMARY KEY, content BLOB NOT NULL);
CREATE TABLE edge (a INTEGER NOT NULL, b INTEGER NOT NULL, content BLOB NOT NULL, PRIMARY KEY (a, b)) WITHOUT ROWID;
CREATE TABLE details (number INTEGER PRIMARY KEY, content BLOB NOT NULL);
CREATE TABLE place (number INTEGER PRIMARY KEY, content BLOB NOT NULL);
CREATE TABLE place_block (first INTEGER PRIMARY KEY, content BLOB NOT NULL);
"""
UNREADABLE = (sqlite3.DatabaseError, ValueError, TypeError, OverflowError)
"""What reading a damaged file can end in: rows that SQLite does not notice as damaged can be of any type."""
_MIGRATIONS: dict[int, str] = {}
"""By version: what brings the tables from it to the next one, a statement in each line."""


def is_there(path: Path) -> bool:
    """Return whether there is a file that holds anything; an empty one is as good as none."""
    try:
        return path.stat().st_size > 0
    except (FileNotFoundError, NotADirectoryError):
        return False


def connect(path: Path, is_written: bool) -> sqlite3.Connection:
    """Open a map for reading alone, or for writing; for writing it is made where there is none.

    Raises ConfigError for a folder, for what is no map, or for one of a newer version; MapError where it is damaged or
    cannot be opened.
    """
    if path.is_dir():
        raise ConfigError(f"{path} is a folder: give the name of a map's file in it")
    if is_there(path):
        with path.open("rb") as file:
            if file.read(len(_SQLITE)) != _SQLITE:
                raise ConfigError(
                    f"{path} is no map: give one that `odom run SOURCE --map FILE` has made, or a new name"
                )
        if not is_written:
            with raising_map_errors(path):
                _undo_half_a_change(path)
    if not is_written and not is_there(path):
        raise ConfigError(f"there is no map {path}: make it with `odom run SOURCE --map {path}`")
    with raising_map_errors(path):
        mode = "rwc" if is_written else "ro"
        db = sqlite3.connect(f"{path.resolve().as_uri()}?mode={mode}", uri=True, check_same_thread=False, timeout=10.0)
        try:
            db.isolation_level = None
            db.execute("PRAGMA cell_size_check = ON")
            _prepare(path, db, is_written)
        except BaseException:
            db.close()
            raise
    return db


def _undo_half_a_change(path: Path) -> None:
    """Bring a map back to what it was before a change that a killed process has left half done.

    A connection for reading alone must not write, so it cannot: it refuses to read the map until this was done.
    """
    if path.with_name(f"{path.name}-journal").exists():
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", uri=True, timeout=10.0)) as db:
            db.execute("SELECT count(*) FROM sqlite_schema").fetchone()


def _prepare(path: Path, db: sqlite3.Connection, is_written: bool) -> None:
    (tables,) = db.execute("SELECT count(*) FROM sqlite_schema").fetchone()
    (application,) = db.execute("PRAGMA application_id").fetchone()
    (version,) = db.execute("PRAGMA user_version").fetchone()
    if is_written and not tables and not application:
        db.execute(f"PRAGMA page_size = {_PAGE_BYTES}")
        with transaction(db):
            _execute(db, _TABLES)
            db.execute(f"PRAGMA application_id = {_APPLICATION}")
            db.execute(f"PRAGMA user_version = {VERSION}")
        version = VERSION
    elif application != _APPLICATION:
        raise ConfigError(f"{path} is no map, but another program's database: give another name")
    if version > VERSION:
        raise ConfigError(f"{path} was made by a newer version of odom (format {version}): update odom to open it")
    is_ours = _statements(db) == sorted(_TABLES.strip().replace(";", "").split("\n"))
    if version < 1 or (version == VERSION and not is_ours):
        raise damaged(path, "its tables are not ours")
    if version < VERSION and not is_written:
        raise MapError(f"{path} is of an older format ({version}): `odom run SOURCE --map {path}` brings it up to date")
    for old in range(version, VERSION):
        with transaction(db):
            _execute(db, _MIGRATIONS[old])
            db.execute(f"PRAGMA user_version = {old + 1}")
    if is_written:
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = NORMAL")


def _execute(db: sqlite3.Connection, statements: str) -> None:
    """Execute statements, one in each line, within the open transaction, which `executescript` would commit."""
    for statement in statements.strip().split("\n"):
        db.execute(statement)


def _statements(db: sqlite3.Connection) -> list[str]:
    return sorted(str(sql) for (sql,) in db.execute("SELECT sql FROM sqlite_schema WHERE type = 'table'"))


@contextmanager
def transaction(db: sqlite3.Connection) -> Iterator[None]:
    """Do all of what is inside, or nothing."""
    db.execute("BEGIN IMMEDIATE")
    try:
        yield
        db.execute("COMMIT")
    except BaseException:
        if db.in_transaction:
            db.execute("ROLLBACK")
        raise


@contextmanager
def raising_map_errors(path: Path) -> Iterator[None]:
    """Turn what SQLite says of a damaged file into a MapError that says what to do."""
    try:
        yield
    except sqlite3.OperationalError as error:
        raise MapError(f"{path} cannot be opened or written: {error}") from error
    except UNREADABLE as error:
        raise damaged(path, str(error)) from error


def damaged(path: Path, what: str) -> MapError:
    """Return the error that says what is damaged, and what can be done about it."""
    return MapError(f"{path} is damaged ({what}): `odom map check {path} --mend NEW.map` saves what is whole")


def lock(path: Path) -> int:
    """Hold a map for writing until the descriptor that is returned is closed, after all connections.

    Raises MapError where another process writes it, ConfigError where it cannot be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise ConfigError(f"{path} cannot be written: {error.strerror}; give another --map") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise MapError(f"{path} is being written by another process: let it end, or give --localize") from error
    return descriptor
