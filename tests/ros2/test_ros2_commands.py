"""`--ros2` as users type it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from ros2_network import DOMAIN, other_node, tokens
from typer.testing import CliRunner

from odom.cli import app
from odom.cli.optional_domain import filled_in
from odom.wire import WireSettings
from odom.wire.ros2.names import endpoint_of
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
