"""A recording that is published as a driver would is tracked as well as the folder that it is from."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest
from play_tum import driver_messages, paced
from ros2_network import DOMAIN, free_port, other_node, router
from test_bridge import PYTHON, bridge, player

from odom.wire import Message
from odom.wire.ros2 import Ros2Node
from odom.wire.ros2.names import NodeName

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
        port, play = _dds(stack) if way == "dds" else _zenoh(stack)
        publishing = threading.Thread(
            target=lambda: [play(m) for m in paced(driver_messages(folder, form == "compressed"), SPEED)]
        )
        publishing.start()
        options = [f"domain={DOMAIN}", f"router=tcp/127.0.0.1:{port}", "start_s=30", "end_s=20"]
        over = report(tmp_path / "over", "ros2:/camera", *(f"--option={option}" for option in options))
        publishing.join()
    figures = tmp_path / "figures.json"
    truth = folder / "groundtruth.txt"
    subprocess.run([*ODOM, "eval", str(tmp_path / "over"), str(truth), "--json", str(figures)], check=True)
    ate_m = json.loads(figures.read_text())["ate_m"]
    print(f"{way}, {form}: ATE {ate_m:.5f} m, of the folder {whole['ate_m']:.5f} m; tracked {over['tracked']}")
    assert over["tracked"] >= 0.93 * whole["tracked"]
    assert ate_m <= 1.02 * whole["ate_m"]


ODOM = [sys.executable, "-m", "odom"]


def report(out: Path, source: str, *arguments: str) -> dict[str, float]:
    subprocess.run([*ODOM, "run", source, "--headless", "--out", str(out), *arguments], check=True, timeout=400)
    found: dict[str, float] = json.loads((out / "report.json").read_text())
    return found


def _zenoh(stack: ExitStack) -> tuple[int, Callable[[Message], None]]:
    port = free_port()
    stack.enter_context(router(port))
    session = stack.enter_context(other_node(port)).zenoh
    node = Ros2Node(session, NodeName(DOMAIN, str(session.info.zid()), 0, "/", "camera"))
    stack.callback(node.close)
    return port, node.tell


def _dds(stack: ExitStack) -> tuple[int, Callable[[Message], None]]:
    port, _ = stack.enter_context(bridge())
    return port, stack.enter_context(player())
