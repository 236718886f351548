"""Who gets in and who may say what, tried on a real router process."""

import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from pydantic import JsonValue
from rig import Process, free_port, processes

from odom.errors import ConfigError, WireError
from odom.frame import Stamp
from odom.wire import Message, WireSettings
from odom.wire.certificates import make_keys
from odom.wire.codec import encode_depth, encode_pose, encode_text
from odom.wire.security import SecuritySettings, grants, secured, security_configuration
from odom.wire.session import WireSession, open_session

IDENTITIES = ("router", "sensor.cam0", "odometry.cam0", "recorder", "viewer", "mocap")
PASSWORD = "correct horse battery staple"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    make_keys(folder, IDENTITIES, [], 30)
    return folder


def identity(keys: Path, name: str) -> SecuritySettings:
    return SecuritySettings(certificate=keys / f"{name}.pem", key=keys / f"{name}.key", ca=keys / "ca.pem")


def as_client(endpoint: str, security: SecuritySettings, timeout_ms: int, **zenoh: JsonValue) -> WireSettings:
    patience: dict[str, JsonValue] = {"connect/timeout_ms": timeout_ms}
    return WireSettings(mode="client", connect=(endpoint,), listen=(), security=security, zenoh=patience | zenoh)


class Rig:
    """A router with rules, and clients of it."""

    def __init__(self, router: Process, endpoint: str, stack: ExitStack) -> None:
        self.router, self.endpoint, self._stack = router, endpoint, stack

    def client(self, security: SecuritySettings, timeout_ms: int = 2000) -> WireSession:
        return self._stack.enter_context(open_session(as_client(self.endpoint, security, timeout_ms)))


@pytest.fixture(scope="module")
def tls_router(keys: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Process, str]]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    files = [keys / "router.pem", keys / "router.key", keys / "ca.pem"]
    allowed = [part for name in IDENTITIES[1:] for part in ("--allow", name)]
    with processes() as started:
        arguments = ["--tls", *files, "router", "--listen", endpoint, *allowed]
        started.append(Process("router", tmp_path_factory.mktemp("router") / "router.log", arguments))
        started[0].wait_for("routing at", 60)
        yield started[0], endpoint


@pytest.fixture
def tls_rig(tls_router: tuple[Process, str]) -> Iterator[Rig]:
    with ExitStack() as stack:
        yield Rig(*tls_router, stack)


def frame(topic: str = "cam0/depth/image_raw") -> Message:
    return encode_depth(topic, Stamp(1), np.zeros((4, 4), dtype=np.uint16))


def pose(topic: str) -> Message:
    return encode_pose(topic, Stamp(1), np.eye(4), "map")


def heard(session: WireSession, seconds: float = 0.6) -> set[str]:
    """What arrives now; the subscription was made before by `listen`."""
    end = time.monotonic() + seconds
    topics = set()
    while (left := end - time.monotonic()) > 0:
        delivery = session.listener.receive(left)  # type: ignore[attr-defined]
        if delivery is not None:
            topics.add(delivery.message.topic)
    return topics


def listen(session: WireSession, *keys: str) -> None:
    session.listener = session.subscriber(keys)  # type: ignore[attr-defined]
    time.sleep(0.3)


def test_everybody_does_his_work_under_the_rules(tls_rig: Rig, keys: Path) -> None:
    sensor, odometry, viewer = (
        tls_rig.client(identity(keys, name)) for name in ("sensor.cam0", "odometry.cam0", "viewer")
    )
    mocap = tls_rig.client(identity(keys, "mocap"))
    listen(odometry, "cam0/**", "truth/**")
    listen(viewer, "**")
    listen(sensor, "cam0/ack/**")
    alive: set[str] = set()
    odometry.watch("cam0/**", lambda key, living: alive.add(key) if living else alive.discard(key))
    sensor.announce("cam0/alive")
    sensor.announce("cam0/alive/sensor/rig-1")
    viewer.announce("cam0/alive/viewer")
    sensor.publisher().put(frame())
    mocap.publisher().put(pose("truth/rig/pose"))
    odometry.publisher().put(pose("cam0/pose"))
    odometry.publisher().put(encode_text("cam0/ack/odometry", Stamp(1), "1"))
    assert heard(odometry) >= {"cam0/depth/image_raw", "truth/rig/pose"}
    assert heard(viewer) >= {"cam0/depth/image_raw", "truth/rig/pose", "cam0/pose"}
    assert heard(sensor) == {"cam0/ack/odometry"}
    assert alive == {"cam0/alive", "cam0/alive/sensor/rig-1", "cam0/alive/viewer"}


def test_a_viewer_may_not_publish_and_a_sensor_only_its_own_images(tls_rig: Rig, keys: Path) -> None:
    sensor, viewer, recorder = (tls_rig.client(identity(keys, name)) for name in ("sensor.cam0", "viewer", "recorder"))
    listen(recorder, "**")
    viewer.publisher().put(pose("cam0/pose"))
    viewer.publisher().put(frame())
    viewer.zenoh.put("cam0/odom", b"undeclared")
    sensor.publisher().put(pose("cam0/odom"))
    sensor.publisher().put(frame("cam1/depth/image_raw"))
    assert heard(recorder, 1.5) == set()
    sensor.publisher().put(frame())
    assert heard(recorder) == {"cam0/depth/image_raw"}
    for who, key in [
        ("viewer", "cam0/pose"),
        ("viewer", "cam0/depth/image_raw"),
        ("viewer", "cam0/odom"),
        ("sensor.cam0", "cam0/odom"),
        ("sensor.cam0", "cam1/depth/image_raw"),
    ]:
        tls_rig.router.wait_for(f"refused: {who} may not publish {key}", 5)


def test_listening_is_not_mistaken_for_publishing(tls_rig: Rig, keys: Path) -> None:
    before = tls_rig.router.said
    viewer = tls_rig.client(identity(keys, "viewer"))
    listen(viewer, "cam0/odom", "cam0/pose", "cam0/color/**")
    sensor = tls_rig.client(identity(keys, "sensor.cam0"))
    sensor.publisher().put(frame())
    time.sleep(1.0)
    assert "refused" not in tls_rig.router.said[len(before) :]


def test_a_sensor_may_not_listen_to_others(tls_rig: Rig, keys: Path) -> None:
    sensor, odometry = (tls_rig.client(identity(keys, name)) for name in ("sensor.cam0", "odometry.cam0"))
    listen(sensor, "cam0/pose")
    odometry.publisher().put(pose("cam0/pose"))
    assert heard(sensor) == set()
    tls_rig.router.wait_for("refused: sensor.cam0 may not subscribe to cam0/pose", 5)


def test_in_the_clear_nobody_gets_in(tls_rig: Rig) -> None:
    before = len(tls_rig.router.said)
    with pytest.raises(WireError, match="cannot open"):
        tls_rig.client(SecuritySettings())
    tls_rig.router.wait_for("refused: a client that does not speak TLS", 5, before)


def test_a_router_says_that_it_listens_encrypted_where_it_was_given_tcp(tls_rig: Rig) -> None:
    assert f"routing at {tls_rig.endpoint.replace('tcp/', 'tls/')} (tls in place of tcp)" in tls_rig.router.said


def test_a_client_without_any_certificate_is_refused_and_logged(tls_rig: Rig, keys: Path) -> None:
    before = len(tls_rig.router.said)
    endpoint = tls_rig.endpoint.replace("tcp/", "tls/")
    knows_the_authority = {"transport/link/tls/root_ca_certificate": str(keys / "ca.pem")}
    settings = as_client(endpoint, SecuritySettings(), 2000, **knows_the_authority)
    with pytest.raises(WireError, match="cannot open"), open_session(settings):
        pass
    tls_rig.router.wait_for("refused: a client that shows no certificate", 5, before)


def test_a_certificate_of_a_foreign_authority_is_refused_and_logged(tls_rig: Rig, keys: Path, tmp_path: Path) -> None:
    before = len(tls_rig.router.said)
    make_keys(tmp_path, ["viewer"], [], 30)
    forged = SecuritySettings(certificate=tmp_path / "viewer.pem", key=tmp_path / "viewer.key", ca=keys / "ca.pem")
    with pytest.raises(WireError, match="cannot open"):
        tls_rig.client(forged)
    tls_rig.router.wait_for("refused: a client whose certificate another authority has signed", 5, before)


def test_a_router_of_a_foreign_authority_is_not_trusted(tls_rig: Rig, keys: Path, tmp_path: Path) -> None:
    before = len(tls_rig.router.said)
    make_keys(tmp_path, ["viewer"], [], 30)
    with pytest.raises(WireError, match="cannot open"):
        tls_rig.client(
            SecuritySettings(certificate=keys / "viewer.pem", key=keys / "viewer.key", ca=tmp_path / "ca.pem")
        )
    tls_rig.router.wait_for("refused: a client that does not accept this router's certificate", 5, before)


def test_an_identity_that_is_not_allowed_gets_nothing(tls_rig: Rig, keys: Path) -> None:
    make_keys(keys, ["viewer.cam7"], [], 30)
    stranger = tls_rig.client(identity(keys, "viewer.cam7"))
    listen(stranger, "**")
    sensor = tls_rig.client(identity(keys, "sensor.cam0"))
    sensor.publisher().put(frame())
    assert heard(stranger) == set()
    tls_rig.router.wait_for("refused: viewer.cam7 at 127.0.0.1 is not among those allowed", 5)


@pytest.fixture(scope="module")
def password_router(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Process, str]]:
    folder = tmp_path_factory.mktemp("router")
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    users = folder / "users"
    users.write_text(f"sensor.cam0:{PASSWORD}\nviewer:{PASSWORD}\n")
    with processes() as started:
        arguments = [
            "router",
            "--listen",
            endpoint,
            "--users-file",
            users,
            "--allow",
            "sensor.cam0",
            "--allow",
            "viewer",
        ]
        started.append(Process("router", folder / "router.log", arguments))
        started[0].wait_for("routing at", 60)
        yield started[0], endpoint


@pytest.fixture
def password_rig(password_router: tuple[Process, str]) -> Iterator[Rig]:
    with ExitStack() as stack:
        yield Rig(*password_router, stack)


def with_password(tmp_path: Path, user: str, password: str) -> SecuritySettings:
    file = tmp_path / f"password-{user}"
    file.write_text(password + "\n")
    return SecuritySettings(user=user, password_file=file)


def test_user_and_password_open_the_door_and_give_the_rights(password_rig: Rig, tmp_path: Path) -> None:
    sensor = password_rig.client(with_password(tmp_path, "sensor.cam0", PASSWORD))
    viewer = password_rig.client(with_password(tmp_path, "viewer", PASSWORD))
    listen(viewer, "**")
    sensor.publisher().put(frame())
    sensor.publisher().put(pose("cam0/pose"))
    assert heard(viewer) == {"cam0/depth/image_raw"}
    password_rig.router.wait_for("refused: sensor.cam0 may not publish cam0/pose", 5)


@pytest.mark.parametrize(
    ("user", "password", "fault"),
    [("viewer", "wrong", "whose password is wrong"), ("intruder", PASSWORD, "whose user is not known here")],
)
def test_a_wrong_password_or_user_is_refused_and_logged(
    password_rig: Rig, tmp_path: Path, user: str, password: str, fault: str
) -> None:
    with pytest.raises(WireError, match="cannot open"):
        password_rig.client(with_password(tmp_path, user, password))
    password_rig.router.wait_for(f"refused: a client at 127.0.0.1 {fault}", 5)
    assert PASSWORD not in password_rig.router.said


def test_nobody_gets_in_without_a_password(password_rig: Rig) -> None:
    with pytest.raises(WireError, match="cannot open"):
        password_rig.client(SecuritySettings())
    password_rig.router.wait_for("refused: a client at 127.0.0.1 that gives no user and password", 5)


def test_what_is_refused_again_and_again_does_not_fill_the_log(password_rig: Rig, tmp_path: Path) -> None:
    sensor = password_rig.client(with_password(tmp_path, "sensor.cam0", PASSWORD))
    for attempt in range(300):
        sensor.zenoh.put("cam0/path", b"again")
        sensor.zenoh.put(f"cam0/attempt{attempt}", b"another")
    password_rig.router.wait_for("sensor.cam0 may not publish cam0/path, 100 times by now", 15)
    password_rig.router.wait_for("sensor.cam0 in many other ways, 100 times by now", 15)
    assert password_rig.router.said.count("sensor.cam0 may not publish cam0/path") == 3
    assert password_rig.router.said.count("sensor.cam0 may not publish cam0/attempt") <= 50


def test_no_secret_stands_in_settings_or_errors(tmp_path: Path) -> None:
    security = with_password(tmp_path, "viewer", PASSWORD)
    settings = as_client("tcp/127.0.0.1:9", security, 300)
    assert PASSWORD not in repr(settings) + settings.model_dump_json()
    with pytest.raises(WireError) as refused, open_session(settings):
        pass
    assert PASSWORD not in str(refused.value)


def test_private_keys_are_for_their_owner_only(keys: Path) -> None:
    for file in keys.glob("*.key"):
        assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_making_keys_again_adds_but_never_replaces(tmp_path: Path) -> None:
    make_keys(tmp_path, ["viewer"], [], 30)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert [file.name for file in make_keys(tmp_path, ["viewer", "recorder"], [], 30)] == [
        "recorder.key",
        "recorder.pem",
    ]
    assert {name: (tmp_path / name).read_bytes() for name in before} == before


def test_mistakes_are_explained(keys: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="role"):
        grants("admin")
    with pytest.raises(ConfigError, match=r"sensor\.cam0"):
        grants("sensor")
    with pytest.raises(ConfigError, match="three files"):
        security_configuration(SecuritySettings(certificate=keys / "viewer.pem"))
    with pytest.raises(ConfigError, match="cannot be read"):
        security_configuration(identity(tmp_path, "viewer"))
    with pytest.raises(ConfigError, match="identities"):
        security_configuration(SecuritySettings(access=("viewer",)))


def test_with_tls_nothing_goes_in_the_clear(keys: Path) -> None:
    assert secured(["tcp/127.0.0.1:7447", "tls/a:1"], identity(keys, "viewer")) == ["tls/127.0.0.1:7447", "tls/a:1"]
    assert secured(["tcp/127.0.0.1:7447"], SecuritySettings()) == ["tcp/127.0.0.1:7447"]
