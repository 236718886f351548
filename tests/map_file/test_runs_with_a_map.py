"""`odom run --map`: the command itself makes a map, finds the camera in it, and refuses what it cannot open."""

import json
import os
import subprocess
import sys
from pathlib import Path

import made_up_map
import pytest
from refused import refusal

PROJECT = Path(__file__).parents[2]
RECORDING = PROJECT / "recordings" / "arena.mcap"


def odom(*words: str | Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(PROJECT)}
    command = [sys.executable, "-m", "odom", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)


@pytest.mark.long
def test_a_run_leaves_a_map_and_the_next_one_is_found_in_it(tmp_path):
    path = tmp_path / "lab.map"
    made = odom("run", RECORDING, "--end", 2, "--headless", "--map", path, "--out", tmp_path / "made")
    assert made.returncode == 0, made.stderr
    assert [p.name for p in tmp_path.iterdir() if p.is_file()] == ["lab.map"]
    content = path.read_bytes()
    found = odom(
        "run",
        RECORDING,
        "--start",
        1,
        "--end",
        2,
        "--headless",
        "--map",
        path,
        "--localize",
        "--out",
        tmp_path / "found",
    )
    assert found.returncode == 0, found.stderr
    report = json.loads((tmp_path / "found" / "report.json").read_text())
    assert report["map"] == {"file": str(path), "localize": True, "lost": 0}
    assert report["tracked"] == report["frames"] > 5
    assert path.read_bytes() == content
    both = [dict(line.split(" ", 1) for line in read(tmp_path / name)) for name in ("made", "found")]
    for stamp, pose in both[1].items():
        before, now = (list(map(float, text.split()))[:3] for text in (both[0][stamp], pose))
        assert max(abs(a - b) for a, b in zip(before, now, strict=True)) < 0.01
    said = odom("map", "info", path)
    assert "key frames of session 0" in said.stdout


def read(folder: Path) -> list[str]:
    lines = (folder / "trajectory.txt").read_text().splitlines()
    return [line for line in lines if not line.startswith("#")]


@pytest.mark.long
def test_a_camera_is_found_in_the_merged_map_of_two_runs(tmp_path):
    for name, start, end in (("second", 3, 6), ("first", 0, 4)):
        path = tmp_path / f"{name}.map"
        made = odom(
            "run", RECORDING, "--start", start, "--end", end, "--headless", "--map", path, "--out", tmp_path / name
        )
        assert made.returncode == 0, made.stderr
    both = tmp_path / "both.map"
    merged = odom("map", "merge", tmp_path / "first.map", tmp_path / "second.map", "-o", both)
    assert merged.returncode == 0, merged.stderr
    assert "of session 0, 1" in merged.stdout
    found = odom("run", RECORDING, "--end", 6, "--headless", "--map", both, "--localize", "--out", tmp_path / "found")
    assert found.returncode == 0, found.stderr
    report = json.loads((tmp_path / "found" / "report.json").read_text())
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
