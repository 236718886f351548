"""An import of which nothing can be used is a failure that says why, and leaves no file."""

import shutil
from pathlib import Path

import pytest
from refused import process_as_it_was
from test_tum import write_folder
from typer.testing import CliRunner

from odom.cli import app
from odom.errors import OdomError


def failure(*arguments: str | Path) -> str:
    """The words with which `odom import ARGUMENTS` fails."""
    with process_as_it_was():
        done = CliRunner().invoke(app, ["import", *map(str, arguments)])
    assert isinstance(done.exception, OdomError), (done.output, done.exception)
    return str(done.exception)


@pytest.mark.parametrize(("stream", "name"), [("rgb", "colour"), ("depth", "depth")])
def test_a_folder_without_any_image_of_a_stream_is_told_with_the_reason(tmp_path: Path, stream: str, name: str) -> None:
    folder = write_folder(tmp_path / "tum")
    shutil.rmtree(folder / stream)
    (folder / stream).mkdir()
    words = failure(folder, tmp_path / "out.mcap")
    assert f"none of its {name} images can be used" in words
    assert "no such file" in words
    assert not list(tmp_path.glob("out*"))


def test_a_start_behind_the_end_imports_nothing(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "tum")
    assert "--start may be behind its end" in failure(folder, tmp_path / "out.mcap", "--start", "1000")
    assert not list(tmp_path.glob("out*"))


@pytest.mark.parametrize("name", ["out", "out.bag", "out.mcap.zst"])
def test_a_name_by_which_no_recording_is_known_is_refused(tmp_path: Path, name: str) -> None:
    assert "ends with .mcap" in failure(write_folder(tmp_path / "tum"), tmp_path / name)
    assert not list(tmp_path.glob("out*"))
