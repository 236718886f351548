"""A recording that is published as a driver would is tracked as well as the folder that it is from."""

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import islice
from pathlib import Path

import pytest
from play_tum import driver_messages, on_time
from ros2_network import DOMAIN, free_port, other_node, router
from test_bridge import PYTHON, Player, bridge, player

from odom.wire import Message
from odom.wire.ros2 import Ros2Node
from odom.wire.ros2.graph import RosGraph
from odom.wire.ros2.names import SUBSCRIBER, NodeName
from odom.wire.ros2.qos import Qos
from odom.wire.session import WireSession

SPEED = float(os.environ.get("ODOM_TEST_SPEED", "0.5"))
"""Of the recording: slow enough that a crowded machine misses no frame, so that accuracies can be compared."""


@pytest.mark.slow
@pytest.mark.parametrize("form", ["raw", "compressed"])
@pytest.mark.parametrize("way", ["zenoh", "dds"])
def test_a_driver_is_tracked_as_well_as_the_folder(shared_data: Path, tmp_path: Path, way: str, form: str) -> None:
    if way == "dds" and not PYTHON:
        pytest.skip("rclpy is missing: pip install '.[ros2]', or ODOM_TEST_RCLPY_PYTHON=PYTHON")
    folder = shared_data / "tum_fr1_xyz"
    whole = report(tmp_path / "folder", str(folder))
    with ExitStack() as stack:
        port, camera = _dds(stack) if way == "dds" else _zenoh(stack)
        for message in islice(driver_messages(folder, form == "compressed"), 9):
            camera.offer(message)

        def play() -> None:
            camera.wait_until_heard()
            for message in on_time(driver_messages(folder, form == "compressed"), SPEED):
                camera(message)

        options = [f"domain={DOMAIN}", f"router=tcp/127.0.0.1:{port}", "start_s=300", "end_s=20"]
        over = report(tmp_path / "over", "ros2:/camera", *(f"--option={option}" for option in options), when_ready=play)
    figures = tmp_path / "figures.json"
    truth = folder / "groundtruth.txt"
    subprocess.run([*ODOM, "eval", str(tmp_path / "over"), str(truth), "--json", str(figures)], check=True)
    ate_m = json.loads(figures.read_text())["ate_m"]
    print(f"{way}, {form}: ATE {ate_m:.5f} m, of the folder {whole['ate_m']:.5f} m; tracked {over['tracked']}")
    assert over["tracked"] >= 0.99 * whole["tracked"]
    assert ate_m <= 1.02 * whole["ate_m"]


ODOM = [sys.executable, "-m", "odom"]


def report(out: Path, source: str, *arguments: str, when_ready: Callable[[], None] | None = None) -> dict[str, float]:
    """Run, call `when_ready` in a thread as soon as the odometry says that it is, and return the report."""
    command = [*ODOM, "run", source, "--headless", "--out", str(out), *arguments]
    playing = threading.Thread(target=when_ready)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            print(line, end="")
            if when_ready is not None and "ready after" in line:
                playing.start()
    assert process.returncode == 0
    if when_ready is not None:
        playing.join()
    found: dict[str, float] = json.loads((out / "report.json").read_text())
    return found


class ZenohCamera:
    """A node of ROS 2 on Zenoh that publishes messages."""

    def __init__(self, session: WireSession) -> None:
        self.node = Ros2Node(session.zenoh, NodeName(DOMAIN, str(session.zenoh.info.zid()), 0, "/", "camera"))
        self._listeners = RosGraph(session, DOMAIN, SUBSCRIBER)
        self._offered: set[str] = set()

    def __call__(self, message: Message) -> None:
        self.node.tell(message)

    def offer(self, message: Message) -> None:
        self.node.offer(message.topic, message.type_name, Qos())
        self._offered.add(f"/{message.topic}")

    def wait_until_heard(self) -> None:
        while not self._offered <= self._listeners.endpoints().keys():
            time.sleep(0.05)


def _zenoh(stack: ExitStack) -> tuple[int, ZenohCamera]:
    port = free_port()
    stack.enter_context(router(port))
    camera = ZenohCamera(stack.enter_context(other_node(port)))
    stack.callback(camera.node.close)
    return port, camera


def _dds(stack: ExitStack) -> tuple[int, Player]:
    port, _ = stack.enter_context(bridge())
    return port, stack.enter_context(player())
