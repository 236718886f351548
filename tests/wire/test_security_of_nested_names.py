"""Rules and certificates of devices whose namespace has several parts, `lab/cam0`."""

import time
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.x509.oid import NameOID

from odom.frame import Stamp
from odom.wire import Topics, WireSettings
from odom.wire.certificates import make_keys
from odom.wire.codec import encode_text
from odom.wire.security import SecuritySettings
from odom.wire.session import open_session


@pytest.mark.parametrize("namespace", ["cam0", "lab/cam0", "lab/left/cam0"])
def test_a_recorder_of_any_device_may_acknowledge_and_nothing_more(
    endpoint: str, tmp_path: Path, namespace: str
) -> None:
    topics = Topics(namespace)
    (tmp_path / "users").write_text("recorder:secret\n")
    (tmp_path / "password").write_text("secret\n")
    rules = SecuritySettings(users_file=tmp_path / "users", access=("recorder",))
    known = SecuritySettings(user="recorder", password_file=tmp_path / "password")
    living: list[str] = []
    with (
        open_session(WireSettings(mode="router", connect=(), listen=(endpoint,), security=rules)) as router,
        open_session(WireSettings(mode="client", connect=(endpoint,), listen=(), security=known)) as client,
    ):
        subscriber = router.subscriber(("**",))
        router.watch("**", lambda key, alive: living.append(key))
        for key in (topics.ack_of("recorder"), topics.alive_of("recorder"), topics.alive):
            client.announce(key)
        time.sleep(0.3)
        publisher = client.publisher()
        for key in (topics.odom, topics.ack_of("odometry"), topics.ack_of("recorder")):
            publisher.put(encode_text(key, Stamp(1), ""))
        delivery = subscriber.receive(5.0)
        assert delivery is not None
        assert delivery.message.topic == topics.ack_of("recorder")
        assert subscriber.receive(0.2) is None
    assert sorted(set(living)) == sorted([topics.ack_of("recorder"), topics.alive_of("recorder")])


def test_the_keys_of_a_device_with_slashes_in_its_name_are_files_in_the_folder(tmp_path: Path) -> None:
    written = make_keys(tmp_path, ["viewer", "sensor.lab/cam0"], (), 1)
    assert {path.parent for path in written} == {tmp_path}
    certificate = x509.load_pem_x509_certificate((tmp_path / "sensor.lab-cam0.pem").read_bytes())
    assert (tmp_path / "sensor.lab-cam0.key").is_file()
    (name,) = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    assert name.value == "sensor.lab/cam0"
    assert make_keys(tmp_path, ["sensor.lab/cam0"], (), 1) == ()
