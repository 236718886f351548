"""The real commands in real processes, over a network of their own."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from test_tum import FRAMES, write_folder

from odom.errors import DeviceError
from odom.frame import Stamp, to_seconds
from odom.wire import Message, Topics, WireSettings
from odom.wire.codec import encode_pose
from odom.wire.consumer import Consumer
from odom.wire.delivery import Delivery
from odom.wire.recording import RecordingReader
from odom.wire.session import WireSession, open_session
from odom.wire.settings import ANY_LOCAL_PORT
from sensors.catalogue import open_source
from sensors.process import SensorProcess
from sensors.source import SourceOptions

TOPICS = Topics()
KEYS = (TOPICS.color_compressed, TOPICS.depth, TOPICS.camera_info, "truth/**")


class Network:
    """Runs `odom` commands that meet at one endpoint."""

    def __init__(self) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
        self.processes: list[subprocess.Popen[str]] = []

    def start(self, *arguments: str, wire: bool = True) -> subprocess.Popen[str]:
        meeting = ("--connect", self.endpoint, "--listen", ANY_LOCAL_PORT) if wire else ()
        process = subprocess.Popen(
            [sys.executable, "-m", "odom", *arguments, *meeting],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        self.processes.append(process)
        return process

    def run(self, *arguments: str, status: int = 0, wire: bool = False) -> str:
        process = self.start(*arguments, wire=wire)
        output, _ = process.communicate(timeout=120)
        assert process.returncode == status, output
        return output

    def settings(self) -> WireSettings:
        return WireSettings(connect=(), listen=(self.endpoint,))


@pytest.fixture
def network() -> Iterator[Network]:
    network = Network()
    yield network
    for process in network.processes:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.fixture
def hub(network: Network) -> Iterator[WireSession]:
    with open_session(network.settings()) as session:
        yield session


def consume(consumer: Consumer, timeout: float = 60.0) -> list[str]:
    seen = []
    while (delivery := consumer.receive(timeout)) is not None:
        seen.append(delivery.message.topic)
    return seen


def test_replay_record_replay_keeps_every_byte(tmp_path: Path, network: Network, hub: WireSession) -> None:
    folder = str(write_folder(tmp_path / "tum"))
    recordings = [tmp_path / "first.mcap", tmp_path / "second.mcap"]
    for source, recording in ((folder, recordings[0]), (str(recordings[0]), recordings[1])):
        recorder = network.start("record", str(recording))
        sent = network.run("sensor", source, wire=True)
        assert f"{FRAMES} frames" in sent
        assert "end of source" in sent
        assert recorder.wait(60) == 0
    first, second = (list(RecordingReader(recording).messages()) for recording in recordings)
    assert first == second
    original = sorted(open_source(folder, SourceOptions()).messages(), key=lambda message: message.stamp)
    assert first == original


@pytest.mark.long
def test_import_info_recover(tmp_path: Path, network: Network) -> None:
    folder, recording, mended = write_folder(tmp_path / "tum"), tmp_path / "a.mcap", tmp_path / "b.mcap"
    assert f"{FRAMES} frames" in network.run("import", str(folder), str(recording))
    assert "exists" in network.run("import", str(folder), str(recording), status=2)
    told = network.run("info", str(recording))
    assert "/cam0/depth/image_raw" in told
    assert "32 x 24" in told
    assert "complete" in told
    os.truncate(recording, recording.stat().st_size - 100)
    assert "damaged: cut" in network.run("info", str(recording))
    assert "messages saved" in network.run("recover", str(recording), str(mended))
    assert "complete" in network.run("info", str(mended))
    assert "not an MCAP file" in network.run("info", str(folder / "rgb.txt"), status=1)
    network.run("info", str(tmp_path / "nothing.mcap"), status=1)
    assert f"odom import {folder} OUT.mcap" in network.run("info", str(folder), status=2)
    network.run("sensor", str(tmp_path / "nothing.mcap"), status=2)
    network.run("sensor", str(tmp_path), status=2)
    network.run("sensor", str(folder), "--color", "purple", status=2)


@pytest.mark.long
def test_an_import_never_overwrites_what_it_reads(tmp_path: Path, network: Network) -> None:
    recording, link, bag = tmp_path / "a.mcap", tmp_path / "link.mcap", tmp_path / "bag"
    network.run("import", str(write_folder(tmp_path / "tum")), str(recording))
    link.symlink_to(recording)
    bag.mkdir()
    (bag / "metadata.yaml").write_text("")
    (bag / "a_0.mcap").hardlink_to(recording)
    whole = recording.read_bytes()
    for source, output in ((recording, recording), (recording, link), (bag, bag / "a_0.mcap")):
        assert "is what would be read" in network.run("import", str(source), str(output), "--overwrite", status=2)
        assert recording.read_bytes() == whole
    network.run("import", str(recording), str(tmp_path / "b.mcap"))
    network.run("import", str(recording), str(tmp_path / "b.mcap"), "--overwrite")


@pytest.mark.wallclock
def test_whoever_joins_a_live_sensor_is_told_the_calibration_at_once(
    tmp_path: Path, network: Network, hub: WireSession
) -> None:
    network.start("sensor", str(write_folder(tmp_path / "tum")), "--loop", "--realtime")
    first = Consumer(hub, TOPICS, "first", KEYS)
    assert first.receive(60.0) is not None
    for name in ("second", "third", "fourth"):
        time.sleep(0.45)
        joined = time.monotonic()
        consumer = Consumer(hub, TOPICS, name, (TOPICS.camera_info,))
        assert consumer.receive(5.0) is not None
        assert time.monotonic() - joined < 0.25


def test_a_sensor_waits_for_its_consumer_and_repeats_the_calibration(
    tmp_path: Path, network: Network, hub: WireSession
) -> None:
    sensor = network.start("sensor", str(write_folder(tmp_path / "tum")), "--loop")
    late = hub.subscriber([TOPICS.camera_info])
    consumer = Consumer(hub, TOPICS, "odometry", KEYS)
    calibrations, deadline = 0, time.monotonic() + 60.0
    while calibrations < 3:
        assert time.monotonic() < deadline
        assert consumer.receive(60.0) is not None
        calibrations += late.receive(0.0) is not None
        time.sleep(0.01)
    sensor.send_signal(signal.SIGINT)
    consume(consumer)
    assert consumer.ended == "interrupted"
    output, _ = sensor.communicate(timeout=60)
    assert sensor.returncode == 0, output
    assert "interrupted" in output


def test_a_sensor_without_consumers_ends_on_request(tmp_path: Path, network: Network, hub: WireSession) -> None:
    sensor = network.start("sensor", str(write_folder(tmp_path / "tum")))
    here = threading.Event()
    hub.watch(TOPICS.alive, lambda key, alive: here.set() if alive else None)
    assert here.wait(60)
    time.sleep(1.0)
    assert sensor.poll() is None
    sensor.send_signal(signal.SIGTERM)
    output, _ = sensor.communicate(timeout=60)
    assert sensor.returncode == 0, output
    assert "0 frames" in output


@pytest.mark.wallclock
def test_in_real_time_a_recording_takes_its_time(tmp_path: Path, network: Network, hub: WireSession) -> None:
    network.start("sensor", str(write_folder(tmp_path / "tum")), "--realtime", "--rate", "0.5")
    consumer = Consumer(hub, TOPICS, "odometry", (TOPICS.color_compressed,))
    arrivals = []
    while (delivery := consumer.receive(60.0)) is not None:
        assert not delivery.lossless
        arrivals.append((time.monotonic(), to_seconds(delivery.message.stamp)))
    assert len(arrivals) == FRAMES
    wall, recorded = (arrivals[-1][i] - arrivals[0][i] for i in (0, 1))
    assert wall == pytest.approx(2 * recorded, abs=0.1)


@pytest.mark.wallclock
def test_the_death_of_a_sensor_is_seen_at_once(tmp_path: Path, network: Network, hub: WireSession) -> None:
    sensor = network.start("sensor", str(write_folder(tmp_path / "tum")), "--loop")
    changes: list[tuple[bool, float]] = []
    hub.watch(TOPICS.alive, lambda key, alive: changes.append((alive, time.monotonic())))
    consumer = Consumer(hub, TOPICS, "odometry", KEYS)
    for _ in range(20):
        assert consumer.receive(60.0) is not None
    killed = time.monotonic()
    sensor.kill()
    while len(changes) < 2 and time.monotonic() < killed + 5:
        consumer.receive(0.1)
    assert [alive for alive, _ in changes] == [True, False]
    assert changes[1][1] - killed < 2.0


def test_a_cut_recording_is_played_and_mending_advised(tmp_path: Path, network: Network, hub: WireSession) -> None:
    recording = tmp_path / "a.mcap"
    network.run("import", str(write_folder(tmp_path / "tum")), str(recording))
    os.truncate(recording, recording.stat().st_size - 10)
    sensor = network.start("sensor", str(recording))
    consumer = Consumer(hub, TOPICS, "odometry", KEYS)
    assert consume(consumer).count(TOPICS.color_compressed) == FRAMES
    assert consumer.ended == "end of source"
    output, _ = sensor.communicate(timeout=60)
    assert "odom recover" in output
    assert sensor.returncode == 0


def test_a_router_whose_endpoint_is_taken_fails_and_says_so(network: Network, hub: WireSession) -> None:
    said = network.run("router", "--listen", network.endpoint, status=1)
    assert network.endpoint in said
    assert "--listen" in said
    assert "routing at" not in said


class Unplugged:
    """A source whose device goes away."""

    lossless = True
    length = None

    def messages(self) -> Iterator[Message]:
        """Yield one message, then fail."""
        yield encode_pose("truth/camera/pose", Stamp(1), np.eye(4), "mocap")
        raise DeviceError("unplugged")

    def close(self) -> None:
        """Nothing to give back."""


def test_a_failing_source_is_told_to_the_consumers(hub: WireSession, network: Network) -> None:
    with open_session(WireSettings(connect=(network.endpoint,), listen=(ANY_LOCAL_PORT,))) as session:
        sensor = SensorProcess(session, Unplugged(), SourceOptions(), consumers=1)
        consumer = Consumer(hub, TOPICS, "odometry", KEYS)
        ended: list[str | None] = []
        thread = threading.Thread(target=lambda: ended.append(str(consume(consumer)) and consumer.ended))
        thread.start()
        with pytest.raises(DeviceError, match="unplugged"):
            sensor.run(threading.Event())
        thread.join(5.0)
    assert ended == ["failed: unplugged"]


def test_in_real_time_the_calibration_goes_ahead_of_the_first_image(
    hub: WireSession, network: Network, tmp_path: Path
) -> None:
    options = SourceOptions(realtime=True, rate=10.0)
    source = open_source(str(write_folder(tmp_path / "tum")), options)
    with open_session(WireSettings(connect=(network.endpoint,), listen=(ANY_LOCAL_PORT,))) as session:
        sensor = SensorProcess(session, source, options, consumers=1)
        consumer = Consumer(hub, TOPICS, "odometry", KEYS)
        heard: list[Delivery] = []
        thread = threading.Thread(target=lambda: heard.extend(iter(lambda: consumer.receive(60.0), None)))
        thread.start()
        sensor.run(threading.Event())
        thread.join(5.0)
    sent = {delivery.message.topic: delivery.sent for delivery in reversed(heard)}
    color, calibration = sent[TOPICS.color_compressed], sent[TOPICS.camera_info]
    assert color is not None
    assert calibration is not None
    assert color - calibration >= 90_000_000
