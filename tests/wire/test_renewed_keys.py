"""`odom keys` where some are already: it says what would have to be renewed, and touches nothing when it refuses."""

import datetime
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from full_disk import room_for
from refused import process_as_it_was, refusal
from typer.testing import CliRunner

from odom.cli import app
from odom.errors import ConfigError, OdomError
from odom.wire import WireSettings
from odom.wire.certificates import make_keys
from odom.wire.expiry import check_validity, is_due, validity
from odom.wire.security import SecuritySettings
from odom.wire.session import open_session, zenoh_config


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


DAMAGED = b"-----BEGIN PRIVATE KEY-----\nMIG\n-----END PRIVATE KEY-----\n"


@pytest.mark.parametrize(("name", "content"), [("ca.key", b""), ("ca.key", DAMAGED), ("ca.pem", DAMAGED)])
def test_a_damaged_authority_is_refused(tmp_path: Path, name: str, content: bytes) -> None:
    keys(tmp_path, "router")
    (tmp_path / name).write_bytes(content)
    assert f"{name} is damaged" in refusal("keys", tmp_path, "viewer")
    assert not (tmp_path / "viewer.key").exists()


def test_a_damaged_key_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "viewer.key").write_bytes(DAMAGED)
    assert "viewer.key is damaged" in refusal("keys", tmp_path, "router", "viewer")
    assert [path.name for path in tmp_path.iterdir()] == ["viewer.key"]


def test_an_authority_whose_certificate_is_empty_gets_one_by_its_key(tmp_path: Path) -> None:
    keys(tmp_path, "router")
    (tmp_path / "ca.pem").write_bytes(b"")
    assert keys(tmp_path, "router").split() == [str(tmp_path / "ca.pem")]
    certificate(tmp_path / "router.pem").verify_directly_issued_by(certificate(tmp_path / "ca.pem"))


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    assert "give another" in refusal("keys", tmp_path / "file", "router")


def certificate(file: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(file.read_bytes())


def of(folder: Path, name: str) -> WireSettings:
    files = SecuritySettings(certificate=folder / f"{name}.pem", key=folder / f"{name}.key", ca=folder / "ca.pem")
    return WireSettings(connect=(), listen=(), security=files)


def belong_together(folder: Path, name: str) -> bool:
    key = load_pem_private_key((folder / f"{name}.key").read_bytes(), None)
    return key.public_key() == certificate(folder / f"{name}.pem").public_key()


def test_a_certificate_is_valid_between_its_two_times_and_due_in_its_last_days(tmp_path: Path) -> None:
    make_keys(tmp_path, ["viewer"], [], 365)
    known = certificate(tmp_path / "viewer.pem")
    begin, end, day = known.not_valid_before_utc, known.not_valid_after_utc, datetime.timedelta(days=1)
    assert "clock" in (validity(known, begin - day) or "")
    for now in (begin, begin + 100 * day, end):
        assert validity(known, now) is None
    assert f"expired on {end:%Y-%m-%d}; `odom keys FOLDER` says how to renew it" == validity(known, end + day)
    assert [is_due(known, end - left * day) for left in (31, 29, -1)] == [False, True, True]


def test_a_certificate_of_a_day_is_not_due_at_once(tmp_path: Path) -> None:
    make_keys(tmp_path, ["viewer"], [], 1)
    known = certificate(tmp_path / "viewer.pem")
    assert not is_due(known, known.not_valid_before_utc + datetime.timedelta(hours=20))


@pytest.fixture
def expired(tmp_path: Path) -> Path:
    """Keys of a router that have expired since, of a sound authority."""
    make_keys(tmp_path, ["viewer"], [], 365)
    make_keys(tmp_path, ["router"], [], 0)
    return tmp_path


def test_a_process_whose_certificate_has_expired_says_so_and_does_not_start(expired: Path) -> None:
    with pytest.raises(ConfigError, match=r"router\.pem expired on .*`odom keys FOLDER` says how to renew it"):
        zenoh_config(of(expired, "router"))
    check_validity(of(expired, "viewer").security.certificates)


def test_an_expired_authority_is_told_too(expired: Path) -> None:
    (expired / "ca.pem").unlink()
    make_keys(expired, [], [], 0)
    with pytest.raises(ConfigError, match=r"ca\.pem expired on"):
        zenoh_config(of(expired, "viewer"))
    assert "delete it to renew it" in refusal("keys", expired, "viewer")
    (expired / "ca.pem").unlink()
    keys(expired, "viewer")
    certificate(expired / "viewer.pem").verify_directly_issued_by(certificate(expired / "ca.pem"))


@pytest.mark.parametrize("order", [1, -1], ids=["old first", "new first"])
def test_one_valid_certificate_in_the_file_of_authorities_is_enough(
    tmp_path: Path, order: int, caplog: pytest.LogCaptureFixture
) -> None:
    make_keys(tmp_path / "old", [], [], 0)
    make_keys(tmp_path, ["viewer"], [], 365)
    both = [folder / "ca.pem" for folder in (tmp_path / "old", tmp_path)][::order]
    (tmp_path / "ca.pem").write_bytes(b"".join(file.read_bytes() for file in both))
    with open_session(of(tmp_path, "viewer")):
        pass
    assert [record.getMessage() for record in caplog.records if record.levelname == "WARNING"] == []
    assert "router.pem" in keys(tmp_path, "router")


def test_a_file_of_authorities_that_have_all_expired_is_refused(tmp_path: Path) -> None:
    make_keys(tmp_path, ["viewer"], [], 365)
    make_keys(tmp_path / "old", [], [], 0)
    (tmp_path / "ca.pem").write_bytes(2 * (tmp_path / "old" / "ca.pem").read_bytes())
    with pytest.raises(ConfigError, match=r"ca\.pem expired on"):
        zenoh_config(of(tmp_path, "viewer"))


def test_a_certificate_that_soon_expires_is_warned_of_and_renewed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    make_keys(tmp_path, ["router"], [], 365)
    monkeypatch.setattr("odom.wire.certificates._CLOCKS_DIFFER", datetime.timedelta(days=20))
    make_keys(tmp_path, ["viewer"], [], 1)
    for name in ("router", "viewer"):
        with open_session(of(tmp_path, name)):
            pass
    ends = certificate(tmp_path / "viewer.pem").not_valid_after_utc
    assert [record.getMessage() for record in caplog.records if record.levelname == "WARNING"] == [
        f"{tmp_path / 'viewer.pem'} expires on {ends:%Y-%m-%d}; `odom keys FOLDER` says how to renew it"
    ]
    assert "delete viewer.pem and viewer.key to renew" in keys(tmp_path, "router", "viewer")


def test_expired_certificates_are_named_with_what_to_do(expired: Path) -> None:
    assert "delete router.pem and router.key to renew" in keys(expired, "router", "viewer")
    for name in ("router.pem", "router.key"):
        (expired / name).unlink()
    keys(expired, "router", "viewer")
    assert "already holds" in keys(expired, "router", "viewer")
    zenoh_config(of(expired, "router"))


def test_without_identities_all_of_a_folder_are_looked_at_and_none_is_made(expired: Path) -> None:
    make_keys(expired, ["sensor.lab/cam1"], [], 0)
    before = sorted(expired.iterdir())
    told = keys(expired)
    assert "delete router.pem and router.key, sensor.lab-cam1.pem and sensor.lab-cam1.key to renew" in told
    assert f"`odom keys {expired} router sensor.lab/cam1`" in told
    assert sorted(expired.iterdir()) == before
    for name in ("router", "sensor.lab-cam1"):
        (expired / f"{name}.pem").unlink()
        (expired / f"{name}.key").unlink()
    keys(expired, "router", "sensor.lab/cam1")
    assert "already holds the certificates of router, sensor.lab/cam1, viewer" in keys(expired)
    assert sorted(expired.iterdir()) == before


def test_without_identities_a_folder_without_any_gets_those_of_a_rig(tmp_path: Path) -> None:
    keys(tmp_path / "new")
    names = {path.name for path in (tmp_path / "new").iterdir()}
    rig = ("ca", "router", "sensor.cam0", "odometry.cam0", "recorder", "viewer", "mocap")
    assert names == {f"{name}.{kind}" for name in rig for kind in ("pem", "key")}


@pytest.mark.parametrize("content", [None, b""])
def test_a_key_that_lost_its_certificate_gets_one(tmp_path: Path, content: bytes | None) -> None:
    keys(tmp_path, "viewer")
    key = (tmp_path / "viewer.key").read_bytes()
    (tmp_path / "viewer.pem").unlink()
    if content is not None:
        (tmp_path / "viewer.pem").write_bytes(content)
    assert "viewer.pem" in keys(tmp_path, "viewer")
    assert (tmp_path / "viewer.key").read_bytes() == key
    assert belong_together(tmp_path, "viewer")


@pytest.mark.parametrize("content", [None, b""])
def test_a_certificate_that_lost_its_key_is_named_with_what_to_do(tmp_path: Path, content: bytes | None) -> None:
    keys(tmp_path, "viewer")
    (tmp_path / "viewer.key").unlink()
    if content is not None:
        (tmp_path / "viewer.key").write_bytes(content)
    assert "delete viewer.pem and viewer.key to renew" in keys(tmp_path, "viewer")
    (tmp_path / "viewer.pem").unlink()
    keys(tmp_path, "viewer")
    assert belong_together(tmp_path, "viewer")


def test_a_full_disk_is_told_with_the_file_and_leaves_no_half_of_one(tmp_path: Path) -> None:
    keys(tmp_path, "viewer")
    before = sorted(tmp_path.iterdir())
    with room_for(100):
        assert f"{tmp_path / 'router.key'} cannot be written" in keys(tmp_path, "router")
    assert sorted(tmp_path.iterdir()) == before
    keys(tmp_path, "router")
    assert belong_together(tmp_path, "router")
