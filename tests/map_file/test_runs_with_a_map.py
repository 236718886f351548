"""`odom run --map`: the command itself makes a map, finds the camera in it, and refuses what it cannot open."""

import json
import os
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import made_up_map
import pytest
from refused import refusal
from typer.testing import CliRunner

from odom.cli import app
from odom.cli.options import check_map
from odom.map_file.map_file import MapFile

PROJECT = Path(__file__).parents[2]
RECORDING = PROJECT / "recordings" / "arena.mcap"


def odom(*words: str | Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(PROJECT)}
    command = [sys.executable, "-m", "odom", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)


def run_of(folder: Path, *words: str | Path) -> Path:
    """The folder of a run of a part of the recording that ended well."""
    done = odom("run", RECORDING, *words, "--headless", "--out", folder)
    assert done.returncode == 0, done.stderr
    return folder


def map_command(*words: str | Path) -> str:
    """What `odom map` says, without a process of its own."""
    return CliRunner().invoke(app, ["map", *map(str, words)], catch_exceptions=False).output


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The map that a run of the first four seconds has left, and the folder of the run."""
    path = tmp_path_factory.mktemp("first") / "lab.map"
    return path, run_of(path.parent / "made", "--end", "4", "--map", path)


@pytest.mark.long
def test_a_run_leaves_a_map_and_the_next_one_is_found_in_it(first, tmp_path):
    path, made = first
    assert [p.name for p in path.parent.iterdir() if p.is_file()] == ["lab.map"]
    content = path.read_bytes()
    found = run_of(tmp_path, "--start", "1", "--end", "2", "--map", path, "--localize")
    report = json.loads((found / "report.json").read_text())
    assert report["map"] == {"file": str(path), "localize": True, "lost": 0}
    assert report["tracked"] == report["frames"] > 5
    assert path.read_bytes() == content
    both = [dict(line.split(" ", 1) for line in read(folder)) for folder in (made, found)]
    for stamp, pose in both[1].items():
        before, now = (list(map(float, text.split()))[:3] for text in (both[0][stamp], pose))
        assert max(abs(a - b) for a, b in zip(before, now, strict=True)) < 0.01
    assert "key frames of session 0" in map_command("info", path)


def read(folder: Path) -> list[str]:
    lines = (folder / "trajectory.txt").read_text().splitlines()
    return [line for line in lines if not line.startswith("#")]


@pytest.mark.long
def test_a_camera_is_found_in_the_merged_map_of_two_runs(first, tmp_path):
    second, both = tmp_path / "second.map", tmp_path / "both.map"
    run_of(tmp_path / "second", "--start", "3", "--end", "6", "--map", second)
    assert "of session 0, 1" in map_command("merge", first[0], second, "-o", both)
    found = run_of(tmp_path / "found", "--end", "6", "--map", both, "--localize")
    report = json.loads((found / "report.json").read_text())
    assert report["tracked"] == report["frames"] > 40
    assert report["ate_m"] < 0.01


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--localize"], "--localize needs a map"),
        (["--map", "none.map", "--localize"], "there is no map"),
        (["--map", "other.map"], "is no map"),
        (["--map", "cut.map"], "--mend"),
    ],
)
def test_what_cannot_be_opened_is_refused_before_anything_is_touched(words, says, tmp_path):
    whole = tmp_path / "whole.map"
    made_up_map.make(whole, 3)
    (tmp_path / "cut.map").write_bytes(whole.read_bytes()[:-20_000])
    (tmp_path / "other.map").write_text("nothing of ours\n")
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    words = [str(tmp_path / word) if word.endswith(".map") else word for word in words]
    assert says in refusal("run", RECORDING, "--headless", "--out", tmp_path / "out", *words)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("busy.map", "is being written by another process"),
        ("/proc/new.map", "nothing can be written in /proc"),
        ("results/report.json/new.map", "nothing can be written in"),
        pytest.param(
            "others.map",
            "cannot be written",
            marks=pytest.mark.skipif(os.geteuid() == 0, reason="root may write every file"),
        ),
    ],
)
def test_a_map_that_cannot_be_extended_is_refused_before_results_are_moved(name, says, tmp_path):
    for each in ("busy.map", "others.map"):
        made_up_map.make(tmp_path / each, 3)
    (tmp_path / "others.map").chmod(0o444)
    out = tmp_path / "results"
    out.mkdir()
    (out / "report.json").write_text("of the run before")
    with closing(MapFile(tmp_path / "busy.map", is_written=True)):
        before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
        assert says in refusal("run", RECORDING, "--headless", "--out", out, "--map", tmp_path / name)
        assert says in refusal("serve", "--out", out, "--map", tmp_path / name)
        assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


def test_a_map_that_is_checked_stays_as_it_was_and_can_be_extended(tmp_path):
    path = tmp_path / "lab.map"
    made_up_map.make(path, 3)
    before = path.read_bytes(), path.stat().st_mtime_ns, set(tmp_path.iterdir())
    check_map(path, localize=False)
    check_map(tmp_path / "new" / "lab.map", localize=False)
    assert (path.read_bytes(), path.stat().st_mtime_ns, set(tmp_path.iterdir())) == before
    MapFile(path, is_written=True).close()
