"""`odom keys` where some are already: it says what would have to be renewed, and touches nothing when it refuses."""

from pathlib import Path

import pytest
from refused import process_as_it_was, refusal
from typer.testing import CliRunner

from odom.cli import app
from odom.errors import OdomError


def keys(*arguments: str | Path) -> str:
    """What `odom keys ARGUMENTS` prints, or the words with which it fails."""
    with process_as_it_was():
        done = CliRunner().invoke(app, ["keys", *map(str, arguments)])
    if done.exit_code:
        assert isinstance(done.exception, OdomError), done.output
        return str(done.exception)
    return done.output


def test_a_certificate_for_other_hosts_or_days_is_named_with_what_to_do(tmp_path: Path) -> None:
    keys(tmp_path, "router", "viewer", "--host", "rig.local")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for same in ((), ("--host", "rig.local"), ("--days", "365")):
        assert "already holds" in keys(tmp_path, "router", *same)
    for other in (("--host", "new.local"), ("--days", "30")):
        assert "delete router.pem and router.key to renew" in keys(tmp_path, "router", *other)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    for name in ("router.pem", "router.key"):
        (tmp_path / name).unlink()
    assert "router.pem" in keys(tmp_path, "router", "--host", "new.local", "--host", "10.0.0.1")
    assert "already holds" in keys(tmp_path, "router", "--host", "10.0.0.1")


@pytest.mark.parametrize("host", ["a b", "é.local", "", "-x", "tcp/rig:7447"])
def test_a_host_that_is_no_name_is_refused_before_anything_is_written(tmp_path: Path, host: str) -> None:
    assert "--host" in refusal("keys", tmp_path / "keys", "router", f"--host={host}")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["ca.key", "ca.pem"])
@pytest.mark.parametrize("content", [b"", b"-----BEGIN PRIVATE KEY-----\nMIG\n-----END PRIVATE KEY-----\n"])
def test_a_damaged_authority_is_refused(tmp_path: Path, name: str, content: bytes) -> None:
    keys(tmp_path, "router")
    (tmp_path / name).write_bytes(content)
    assert f"{name} is damaged" in refusal("keys", tmp_path, "viewer")
    assert not (tmp_path / "viewer.key").exists()


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    assert "give another" in refusal("keys", tmp_path / "file", "router")
