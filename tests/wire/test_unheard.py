"""A process to which nothing comes says so, with who is there."""

import logging
import threading
import time
from pathlib import Path

import pytest
from private_network import OpenSession
from typer.testing import CliRunner

from odom.cli import app
from odom.errors import OdomError
from odom.wire import Topics
from odom.wire.recorder import Recorder
from odom.wire.recording import RecordingWriter
from odom.wire.unheard import Unheard


def test_a_recorder_of_a_device_that_is_not_there_names_those_that_are(
    open_peer: OpenSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("odom.wire.unheard._FIRST_S", 0.5)
    sensor, receiver = open_peer(), open_peer()
    sensor.announce(Topics("cam1").alive)
    stop = threading.Event()
    threading.Timer(2.0, stop.set).start()
    with RecordingWriter(tmp_path / "a.mcap") as writer:
        Recorder(receiver, Topics("cam9"), writer).run(stop)
    assert [record.getMessage() for record in caplog.records if "nothing has come" in record.getMessage()] == [
        "nothing has come for cam9 (sensors seen: cam1; connected: yes)"
    ]


def test_a_sensor_that_waits_for_its_odometry_is_no_reason_to_warn(
    open_peer: OpenSession, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("odom.wire.unheard._FIRST_S", 0.0)
    monkeypatch.setattr("odom.wire.unheard._AGAIN_S", 0.0)
    caplog.set_level(logging.INFO)
    topics, sensor, receiver = Topics("cam9"), open_peer(), open_peer()
    unheard = Unheard(receiver, topics)
    for key in (topics.alive, topics.ack_of("odometry")):
        sensor.announce(key)
        deadline = time.monotonic() + 10.0
        while not receiver.living(key) and time.monotonic() < deadline:
            time.sleep(0.01)
        unheard.look()
    said = [(record.levelname, record.getMessage()) for record in caplog.records if record.name == "odom.wire.unheard"]
    assert said == [
        ("INFO", "nothing has come for cam9 yet: its sensor is here, an odometry is not"),
        ("WARNING", "nothing has come for cam9 (sensors seen: cam9; connected: yes)"),
    ]


def test_alone_on_the_wire_it_says_that_it_is_not_connected(
    open_peer: OpenSession, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("odom.wire.unheard._FIRST_S", 0.0)
    unheard = Unheard(open_peer(), Topics("cam9"))
    unheard.look()
    unheard.look()
    assert [record.getMessage() for record in caplog.records] == [
        "nothing has come for cam9 (sensors seen: none; connected: no)"
    ]


def test_a_recording_of_nothing_is_a_failure_and_leaves_no_file(
    endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop = threading.Event()
    monkeypatch.setattr("odom.cli.signals.stop_event", lambda: stop)
    threading.Timer(1.0, stop.set).start()
    begun = time.monotonic()
    done = CliRunner().invoke(app, ["record", str(tmp_path / "a.mcap"), "--listen", endpoint])
    assert time.monotonic() - begun < 30.0
    assert isinstance(done.exception, OdomError)
    assert "no message came" in str(done.exception)
    assert not list(tmp_path.iterdir())
