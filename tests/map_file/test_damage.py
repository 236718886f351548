"""A map that was cut, flipped or filled up is refused with what to do, or gives what was written: nothing else."""

import re
import sqlite3
from dataclasses import replace

import made_up_map
import numpy as np
import pytest
import zstandard
from made_up_map import CAMERA
from typer.testing import CliRunner

from odom.cli import app
from odom.errors import ConfigError, MapError, OdomError
from odom.map_file import arrays, database, records, writer
from odom.map_file.arrays import checked, pack, unchecked, unpack
from odom.map_file.counts import Counts
from odom.map_file.map_file import MapFile

KEYFRAMES = 12


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "whole.map"
    made_up_map.make(path, KEYFRAMES)
    return path


def read(path):
    """Everything that the odometry reads of a map: as bytes, None for what is refused alone."""
    opened = MapFile(path, is_written=False)
    try:
        saved = opened.begin(CAMERA)
        poses = [k.T_camera_map.tobytes() + bytes(str((k.stamp, k.first, k.links)), "ascii") for k in saved.keyframes]
        edges = [(e.a, e.b, e.T_a_b.tobytes(), e.covariance.tobytes()) for e in saved.edges]
        details = [opened.fetch(k.number) for k in saved.keyframes]
        places = [opened.fetch_place(k.number) for k in saved.keyframes]
    finally:
        opened.close()
    return (
        poses,
        edges,
        [None if d is None else d.landmarks.position.tobytes() + d.measurements.values.tobytes() for d in details],
        [None if p is None else p.descriptors.tobytes() for p in places],
    )


def is_right(found, expected):
    """Whether poses and registrations are all there, and of the rest nothing is other than it was."""
    rest = zip(found[2] + found[3], expected[2] + expected[3], strict=True)
    return found[:2] == expected[:2] and all(one in (None, was) for one, was in rest)


def refusal_of(path, expected):
    """The words with which a map is refused, empty where it is right."""
    try:
        assert is_right(read(path), expected)
    except (MapError, ConfigError) as error:
        return str(error)
    return ""


def test_flipped_bytes_are_noticed_and_the_rest_is_saved(whole, tmp_path):
    expected, content = read(whole), whole.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for trial in range(150):
        flipped = bytearray(content)
        reach, count = ((200, 2), (len(content), 1), (len(content), 40))[trial % 3]
        for at in rng.integers(0, reach, count):
            flipped[at] ^= 1 << int(rng.integers(8))
        path = tmp_path / f"flipped-{trial}.map"
        path.write_bytes(flipped)
        refusal = refusal_of(path, expected)
        refused += bool(refusal)
        assert re.search("^$|--mend|another name|new name|update odom|cannot", refusal), refusal
    assert 5 < refused < 145


@pytest.mark.parametrize("share", [0.0, 0.001, 0.02, 0.3, 0.7, 0.99])
def test_a_cut_file_is_refused_or_right(whole, tmp_path, share):
    expected, content = read(whole), whole.read_bytes()
    path = tmp_path / "cut.map"
    path.write_bytes(content[: int(share * len(content))])
    assert refusal_of(path, expected) or share > 0.9


def test_a_change_that_was_cut_short_is_undone_by_whoever_reads_next(whole, tmp_path):
    expected, path = read(whole), tmp_path / "cut-short.map"
    path.write_bytes(whole.read_bytes())
    db = sqlite3.connect(path, isolation_level=None)
    db.execute("PRAGMA cache_size = 1")  # what is changed goes to the file at once
    db.execute("BEGIN IMMEDIATE")
    db.execute("UPDATE details SET content = zeroblob(length(content))")
    left = tmp_path / "left.map"  # as a process leaves it that is killed now
    for end in ("", "-journal"):
        left.with_name(left.name + end).write_bytes(path.with_name(path.name + end).read_bytes())
    db.close()
    assert is_right(read(left), expected)
    assert None not in read(left)[2]
    assert not left.with_name("left.map-journal").exists()


def test_mending_saves_what_is_whole(whole, tmp_path):
    content = bytearray(whole.read_bytes())
    for at in range(len(content) // 2, len(content) // 2 + 20_000, 1000):
        content[at] ^= 0xFF
    path, mended = tmp_path / "flipped.map", tmp_path / "mended.map"
    path.write_bytes(content)
    runner = CliRunner()
    assert runner.invoke(app, ["map", "check", str(whole)]).exit_code == 0
    checked = runner.invoke(app, ["map", "check", str(path)])
    assert "damaged: " in checked.output
    assert isinstance(checked.exception, OdomError)
    assert runner.invoke(app, ["map", "check", str(path), "--mend", str(mended)]).exit_code == 0
    assert runner.invoke(app, ["map", "check", str(mended)]).exit_code == 0
    assert KEYFRAMES // 3 < len(read(mended)[0]) < KEYFRAMES


def test_another_file_and_a_newer_map_are_refused(whole, tmp_path):
    other, newer = tmp_path / "other.map", tmp_path / "newer.map"
    other.write_text("not a map\n")
    with pytest.raises(ConfigError, match="no map"):
        MapFile(other, is_written=True)
    assert other.read_text() == "not a map\n"
    newer.write_bytes(whole.read_bytes())
    db = database.connect(newer, is_written=True)
    db.execute(f"PRAGMA user_version = {database.VERSION + 1}")
    db.close()
    with pytest.raises(ConfigError, match="newer version"):
        MapFile(newer, is_written=False)
    with pytest.raises(ConfigError, match="no map"):
        MapFile(tmp_path / "none.map", is_written=False)


def test_two_cannot_write_one_map_and_one_can_read_it(whole, tmp_path):
    path = tmp_path / "held.map"
    path.write_bytes(whole.read_bytes())
    first = MapFile(path, is_written=True)
    first.begin(CAMERA)
    with pytest.raises(MapError, match="another process"):
        MapFile(path, is_written=True)
    assert len(read(path)[0]) == KEYFRAMES
    first.put(made_up_map.changes(KEYFRAMES))
    first.flush()
    assert len(read(path)[0]) == KEYFRAMES + 1
    first.close()
    MapFile(path, is_written=True).close()


def test_a_map_of_another_camera_is_refused(whole):
    opened = MapFile(whole, is_written=False)
    with pytest.raises(MapError, match="another camera"):
        opened.begin(replace(CAMERA, fx=540.0))
    opened.begin(replace(CAMERA, cx=319.6))
    opened.close()


@pytest.mark.parametrize("content", [b"", b"abc", b"\0" * 40, pack({"a": np.arange(3)})[:-1]])
def test_what_is_not_packed_is_not_unpacked(content):
    with pytest.raises(MapError):
        unpack(content)


@pytest.mark.parametrize("read_row", [Counts.of, records.sensor_of])
def test_a_row_that_holds_another_rows_arrays_is_damaged(read_row):
    with pytest.raises(MapError, match="it holds no"):
        read_row(pack({"number": np.arange(1)}))


@pytest.mark.parametrize("states_its_size", [True, False])
def test_what_would_unpack_to_more_than_any_value_has_is_refused(monkeypatch, states_its_size):
    content = pack({"a": np.zeros(1000)})
    if not states_its_size:
        stream = zstandard.ZstdCompressor().compressobj()
        content = checked(stream.compress(zstandard.decompress(unchecked(content))) + stream.flush())
    assert len(unpack(content)["a"]) == 1000
    monkeypatch.setattr(arrays, "_MOST_BYTES", 5000)
    with pytest.raises(MapError):
        unpack(content)


def test_a_full_disk_is_counted_until_it_is_made_good(tmp_path):
    path = tmp_path / "full.map"
    opened = MapFile(path, is_written=True)
    opened.begin(CAMERA)
    opened.put(made_up_map.changes(0))
    opened.flush()
    assert opened._writer is not None
    pages = opened._writer._db.execute("PRAGMA page_count").fetchone()[0]
    opened._writer._db.execute(f"PRAGMA max_page_count = {pages + 1}")
    for number in range(1, 4):
        opened.put(made_up_map.changes(number))
    opened.flush()
    assert opened.unwritten > 0
    assert opened.fetch(3) is not None
    opened._writer._db.execute("PRAGMA max_page_count = 100000")
    opened.flush()
    assert opened.unwritten == 0
    opened.close()
    assert len(read(path)[0]) == 4


def test_what_a_full_disk_made_the_writer_drop_stays_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "_MOST_DETAILS", 1)
    opened = MapFile(tmp_path / "full.map", is_written=True)
    opened.begin(CAMERA)
    assert opened._writer is not None
    pages = opened._writer._db.execute("PRAGMA page_count").fetchone()[0]
    opened._writer._db.execute(f"PRAGMA max_page_count = {pages}")
    for number in range(3):
        opened.put(made_up_map.changes(number))
        opened.flush()
    opened._writer._db.execute("PRAGMA max_page_count = 100000")
    opened.flush()
    assert opened.unwritten == 2
    opened.close()
