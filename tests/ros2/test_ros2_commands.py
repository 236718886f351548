"""`--ros2` as users type it."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from play_tum import driver_messages, on_time
from ros2_network import DOMAIN, other_node, tokens
from typer.testing import CliRunner

from odom.cli import app
from odom.cli.optional_domain import filled_in
from odom.wire import WireSettings
from odom.wire.ros2 import Ros2Node
from odom.wire.ros2.names import NodeName, endpoint_of
from odom.wire.ros2.node import ros2_wire
from odom.wire.session import _listeners
from odom.wire.settings import ANY_LOCAL_PORT, LOCAL

RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (["arena"], ["arena"]),
        (["--ros2"], ["--ros2=3"]),
        (["--ros2", "arena"], ["--ros2=3", "arena"]),
        (["--ros2", "--headless"], ["--ros2=3", "--headless"]),
        (["--ros2", "5", "arena"], ["--ros2", "5", "arena"]),
        (["--ros2=5"], ["--ros2=5"]),
    ],
)
def test_the_domain_may_be_left_out(typed: list[str], meant: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "3")
    assert filled_in(typed) == meant
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert filled_in(["--ros2"]) == ["--ros2=0"]


@pytest.mark.parametrize("domain", ["233", "-1", "x"])
@pytest.mark.parametrize("command", ["run", "sensor", "serve"])
def test_a_domain_that_cannot_be_is_refused(command: str, domain: str) -> None:
    result = CliRunner().invoke(app, [command, *(["arena"] if command != "serve" else []), f"--ros2={domain}"])
    assert result.exit_code == 2
    assert "--ros2" in result.output


def test_the_port_of_ros_is_left_to_its_router() -> None:
    assert [where.partition("#")[0] for where in _listeners(WireSettings(ros2_domain=0))] == [ANY_LOCAL_PORT]
    assert LOCAL in _listeners(WireSettings())[0]
    elsewhere = WireSettings(ros2_domain=0, ros2_router="tcp/robot:7447")
    assert LOCAL in _listeners(elsewhere)[0]
    assert ros2_wire(elsewhere).connect == ("tcp/robot:7447",)


def test_a_run_is_seen_by_ros_with_all_its_topics(port: int, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "odom", "run", str(RECORDING), "--headless", "--realtime", "--ros2", str(DOMAIN)]
    environment = {**os.environ, "ODOM_WIRE__ROS2_ROUTER": f"tcp/127.0.0.1:{port}"}
    seen: set[tuple[str, str]] = set()
    expected = {
        ("/cam0/sensor", f"/cam0/{name}")
        for name in ("color/image_raw/compressed", "depth/image_raw", "color/camera_info", "depth/camera_info")
    } | {
        ("/cam0/odometry", topic)
        for topic in ("/cam0/odom", "/cam0/pose", "/tf", "/tf_static", "/cam0/path", "/cam0/status", "/cam0/features")
    }
    with other_node(port) as other:
        process = subprocess.Popen([*command, "--out", str(tmp_path / "out")], env=environment)
        try:
            while not expected <= seen:
                assert process.poll() is None, seen
                time.sleep(0.2)
                for endpoint in filter(None, map(endpoint_of, tokens(other))):
                    seen.add((endpoint.node.full_name, endpoint.topic))
        finally:
            process.send_signal(signal.SIGINT)
            assert process.wait(60) == 0
    assert not any(topic.endswith(("/ack/odometry", "/history")) for _, topic in seen)


@pytest.mark.long
@pytest.mark.wallclock
def test_the_doctor_looks_at_a_camera_of_ros_as_at_any_source(port: int, shared_data: Path, tmp_path: Path) -> None:
    folder, findings = shared_data / "tum_fr1_xyz", tmp_path / "findings.json"
    where = [f"--option=domain={DOMAIN}", f"--option=router=tcp/127.0.0.1:{port}", "--option=start_s=20"]
    command = [sys.executable, "-m", "odom", "doctor", "ros2:/camera", *where, "--seconds", "5"]
    stop = threading.Event()
    with other_node(port) as session:
        node = Ros2Node(session.zenoh, NodeName(DOMAIN, str(session.zenoh.info.zid()), 0, "/", "camera"))

        def publish() -> None:
            for message in on_time(driver_messages(folder, compressed=False)):
                node.tell(message)
                if stop.is_set():
                    return

        driver = threading.Thread(target=publish)
        driver.start()
        done = subprocess.run([*command, "--json", str(findings)], capture_output=True, text=True, timeout=300)
        stop.set()
        driver.join()
        node.close()
    assert done.returncode == 0, done.stdout + done.stderr
    assert "ros2:/camera: nothing would spoil the odometry" in done.stdout
    told = {each["check"]: each for each in json.loads(findings.read_text())}
    for check in ("pairs", "exposure", "valid depth", "depth noise", "depth registration", "focal length", "tracking"):
        assert told[check]["verdict"] == "good", told[check]
    assert "fx 517.3, fy 516.5 px" in told["focal length"]["value"]
    assert "(sensor 30.0)" in told["colour frames"]["value"]
