"""A map of an older format is brought up to date as a whole, or stays as it was."""

import sqlite3
from contextlib import closing

import pytest
from made_up_map import make

from odom.errors import MapError
from odom.map_file import database

COLUMN, NOTE = "ALTER TABLE keyframe ADD COLUMN extra BLOB", "CREATE TABLE note (content BLOB NOT NULL)"


@pytest.fixture
def path(tmp_path, monkeypatch):
    """A map that a version to come finds older than its own."""
    make(tmp_path / "a.map", 3)
    monkeypatch.setattr(database, "VERSION", 2)
    return tmp_path / "a.map"


def version_and_columns(path):
    with closing(sqlite3.connect(path)) as db:
        columns = [name for _, name, *_ in db.execute("PRAGMA table_info(keyframe)")]
        return db.execute("PRAGMA user_version").fetchone()[0], columns


def test_an_older_map_is_brought_up_to_date_when_it_is_opened_for_writing(path, monkeypatch):
    monkeypatch.setattr(database, "_MIGRATIONS", {1: f"{COLUMN};\n{NOTE};\n"})
    with pytest.raises(MapError, match="older format"):
        database.connect(path, is_written=False)
    with closing(database.connect(path, is_written=True)) as db:
        assert db.execute("SELECT count(*) FROM note").fetchone() == (0,)
    assert version_and_columns(path) == (2, ["number", "content", "extra"])


def test_an_older_map_that_cannot_be_brought_up_to_date_stays_as_it_was(path, monkeypatch):
    monkeypatch.setattr(database, "_MIGRATIONS", {1: f"{COLUMN};\n{COLUMN};\n"})
    with pytest.raises(MapError):
        database.connect(path, is_written=True)
    assert version_and_columns(path) == (1, ["number", "content"])
