"""No damage makes a command end in anything but a result or a refusal that says what to do."""

import os
import subprocess
import sys
from pathlib import Path

import made_up_map
import numpy as np
import pytest
from test_damage import read, refusal_of
from typer.testing import CliRunner

from odom.cli import app
from odom.errors import OdomError

PROJECT = Path(__file__).parents[2]
KEYFRAMES = 8
CASES = 400
ADVICE = (
    "--mend",
    "another name",
    "new name",
    "update odom",
    "no key frame is whole",
    "cannot be opened",
    "saves what",
)


def damaged(content: bytes, case: int) -> bytes:
    """A file that was cut, lost a page, or has one or many bits flipped, in its head or anywhere."""
    rng = np.random.default_rng(case)
    if case % 4 == 0:
        return content[: int(rng.integers(len(content)))]
    out = bytearray(content)
    if case % 4 == 1:
        at = 16384 * int(rng.integers(len(content) // 16384))
        out[at : at + 16384] = bytes(16384)
        return bytes(out)
    reach, count = ((400, 3), (len(content), 1), (len(content), 60))[case // 4 % 3]
    for at in rng.integers(0, reach, count):
        out[at] ^= 1 << int(rng.integers(8))
    return bytes(out)


def said(*words: object) -> tuple[bool, str]:
    """Whether a command succeeds, and what it says; any error but a refusal is raised."""
    result = CliRunner().invoke(app, ["map", *map(str, words)])
    if result.exception is not None and not isinstance(result.exception, OdomError | SystemExit):
        raise result.exception
    return result.exit_code == 0, f"{result.output} {result.exception or ''}"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "whole.map"
    made_up_map.make(path, KEYFRAMES)
    return path


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, CASES, 100))
def test_every_command_on_damaged_maps(whole, tmp_path, first):
    expected, content = read(whole), whole.read_bytes()
    refused = saved = 0
    for case in range(first, first + 100):
        path, new = tmp_path / f"{case}.map", tmp_path / f"{case}-new.map"
        path.write_bytes(damaged(content, case))
        before = path.read_bytes()
        refusal = refusal_of(path, expected)
        refused += bool(refusal)
        for words in (("info", path), ("export", path, "--out", tmp_path / "out"), ("check", path)):
            is_fine, text = said(*words)
            assert is_fine or any(advice in text for advice in ADVICE), (case, words, text)
        is_fine, text = said("prune", path, "-o", new, "--keyframes", KEYFRAMES // 2)
        assert is_fine == new.exists(), (case, text)
        if is_fine:
            assert said("check", new)[0], case
            new.unlink()
        is_fine, text = said("check", path, "--mend", new)
        assert is_fine == new.exists(), (case, text)
        if is_fine:
            saved += 1
            assert said("check", new)[0], case
            kept = read(new)
            assert set(kept[2]) <= set(expected[2]), case
            assert None not in kept[2], case
        assert path.read_bytes() == before
    assert 30 < refused < 100
    assert saved > 40


@pytest.mark.parametrize("command", ["merge", "prune"])
def test_a_full_disk_leaves_nothing_behind(whole, tmp_path, command):
    made_up_map.make(tmp_path / "a.map", 12, day=1)
    words = f"prune {tmp_path}/a.map --keyframes 11"
    if command == "merge":
        words = f"merge {tmp_path}/a.map {whole}"
    before = sorted(tmp_path.iterdir())
    full = subprocess.run(
        ["bash", "-c", f"ulimit -f 200; exec {sys.executable} -m odom map {words} -o {tmp_path}/new.map"],
        capture_output=True, text=True, env=os.environ | {"PYTHONPATH": str(PROJECT)}, timeout=100,
    )  # fmt: skip
    assert full.returncode == 1
    assert "new.map cannot be opened or written" in full.stderr
    assert "Traceback" not in full.stderr
    assert sorted(tmp_path.iterdir()) == before
