"""The file that a viewer writes replaces none that is there, unless that was asked for."""

from pathlib import Path

import pytest
from refused import refusal

from odom.errors import ConfigError, OdomError
from odom.viewer.outputs import Outputs, open_outputs
from odom.viewer.settings import ViewerSettings

KEPT = "a session of yesterday"


@pytest.fixture
def session(tmp_path: Path) -> Path:
    file = tmp_path / "session.rrd"
    file.write_text(KEPT)
    return file


def test_a_file_that_is_there_is_kept(session: Path, endpoint: str) -> None:
    assert "--overwrite" in refusal("view", "--headless", "--rrd", session, "--listen", endpoint)
    assert session.read_text() == KEPT


def test_a_mistyped_call_replaces_nothing(session: Path) -> None:
    assert "nonsense" in refusal("view", "--rrd", session, "--overwrite", "--connect", "nonsense")
    assert session.read_text() == KEPT


def test_it_is_replaced_where_that_was_asked_for(session: Path) -> None:
    with open_outputs(Outputs(file=session, overwrite=True), ViewerSettings(), "cam0"):
        pass
    assert session.read_bytes().startswith(b"RRF")


def test_of_two_viewers_that_write_one_file_the_second_is_refused(tmp_path: Path) -> None:
    opened = [open_outputs(Outputs(file=tmp_path / "new.rrd"), ViewerSettings(), "cam0") for _ in range(2)]
    with opened[0], pytest.raises(ConfigError, match="exists already"), opened[1]:
        pass


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_disk_that_is_full_from_the_start_is_told() -> None:
    outputs = open_outputs(Outputs(file=Path("/dev/full"), overwrite=True), ViewerSettings(), "cam0")
    with pytest.raises(OdomError, match=r"/dev/full is not complete: .*No space"), outputs:
        pass


def test_a_disk_that_becomes_full_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def shut_down(recording: object, *, timeout_sec: float) -> None:
        raise RuntimeError("File-writer thread shut down prematurely")

    outputs = open_outputs(Outputs(file=tmp_path / "a.rrd"), ViewerSettings(), "cam0")
    monkeypatch.setattr("rerun.RecordingStream.flush", shut_down)
    with pytest.raises(OdomError, match=r"a\.rrd is not complete: .*thread"), outputs:
        pass
