"""`odom ros2` between our processes and genuine nodes of rclpy, each in processes of their own."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from play_tum import raw
from ros2_network import DOMAIN, again_and_again, driver, free_port, wire_of

from odom.frame import Camera, Stamp
from odom.wire import Message, Topics
from odom.wire.codec import (
    Status,
    encode_camera_info,
    encode_cloud,
    encode_color_jpeg,
    encode_depth,
    encode_odometry,
    encode_path,
    encode_pose,
    encode_status,
    encode_text,
    encode_tf,
    restamp,
)
from odom.wire.ros2 import join_ros2
from odom.wire.session import open_session

KEYS = Topics()
HERE = Path(__file__).parent
PYTHON = os.environ.get("ODOM_TEST_RCLPY_PYTHON") or (sys.executable if find_spec("rclpy") else "")
pytestmark = [
    pytest.mark.skipif(not PYTHON, reason="rclpy is missing: pip install '.[ros2]', or ODOM_TEST_RCLPY_PYTHON=PYTHON"),
    pytest.mark.process,
    pytest.mark.timeout(180),
]
AT = Stamp(1_700_000_000_123_456_789)
CAMERA = Camera(64, 48, 50.0, 51.0, 31.5, 23.5, (0.1, -0.2, 0.001, 0.002, 0.3))


@contextmanager
def bridge(*arguments: str) -> Iterator[tuple[int, Callable[..., str]]]:
    """Yield the port of a running bridge, and `end(after="")`.

    That waits until a line with `after` has been printed, ends the bridge with Ctrl-C and returns what it printed.
    """
    port = free_port()
    command = [PYTHON, "-m", "odom", "ros2", "--domain", str(DOMAIN), *arguments]
    environment = {**os.environ, "ODOM_WIRE__ROS2_ROUTER": f"tcp/127.0.0.1:{port}"}
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=HERE.parents[1], env=environment
    )
    printed: list[str] = []

    def end(after: str = "") -> str:
        assert process.stdout is not None
        while after and after not in "".join(printed):
            printed.append(process.stdout.readline())
            assert printed[-1], f"the bridge ended before it printed {after!r}: {''.join(printed)}"
        process.send_signal(signal.SIGINT)
        printed.append(process.communicate(timeout=30)[0])
        assert process.returncode == 0, "".join(printed)
        return "".join(printed)

    try:
        yield port, end
    finally:
        if process.returncode is None:
            print(end())


@contextmanager
def listener(how: str, *topics: str) -> Iterator[Iterator[dict[str, Any]]]:
    command = [PYTHON, str(HERE / "rclpy_listener.py"), str(DOMAIN), how, *topics]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            lines = (json.loads(line) for line in process.stdout)
            assert next(lines) == {"ready": True}
            yield lines
        finally:
            process.kill()


class Player:
    """Publishes messages by a node of rclpy in another process."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._process = process
        self._expect("ready")  # on a busy computer ROS takes long

    def __call__(self, message: Message) -> None:
        self._write(f"/{message.topic} {message.type_name} {len(message.payload)}", message.payload)

    def offer(self, message: Message) -> None:
        """Announce the topic of a message."""
        self._write(f"/{message.topic} {message.type_name} 0")

    def wait_until_heard(self) -> None:
        """Return when somebody listens to every topic so far."""
        self._write("wait")
        self._expect("heard")

    def _write(self, line: str, payload: bytes = b"") -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode() + payload)
        self._process.stdin.flush()

    def _expect(self, word: str) -> None:
        assert self._process.stdout is not None
        assert self._process.stdout.readline().decode().strip() == word


@contextmanager
def player() -> Iterator[Player]:
    command = [PYTHON, str(HERE / "rclpy_player.py"), str(DOMAIN)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        try:
            yield Player(process)
        finally:
            process.kill()


def contract() -> list[Message]:
    T, covariance = np.eye(4), np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    T[:3, 3] = 0.1, 0.2, 0.3
    points, colors = np.arange(30, dtype=np.float32).reshape(10, 3), np.full((10, 3), 7, np.uint8)
    return [
        encode_camera_info(KEYS.camera_info, AT, CAMERA, KEYS.frame_camera),
        encode_path(KEYS.path, AT, [(AT, T)], "map"),
        encode_color_jpeg(KEYS.color_compressed, AT, np.zeros((48, 64, 3), np.uint8), KEYS.frame_camera),
        encode_depth(KEYS.depth, AT, np.full((48, 64), 1500, np.uint16), KEYS.frame_camera),
        encode_odometry(KEYS.odom, AT, T, covariance, "odom", KEYS.frame_camera),
        encode_pose(KEYS.pose, AT, T, "map"),
        encode_status(KEYS.status, Status(AT, "cam0/odometry", 1, "UNCERTAIN", {"fps": "30"})),
        encode_cloud(KEYS.keyframes, AT, points, colors, KEYS.frame_camera),
        encode_text(KEYS.end, AT, "end of source"),
    ]


def test_a_node_of_rclpy_reads_every_topic_with_the_fields_that_were_written() -> None:
    messages = contract()
    kept = (KEYS.camera_info, KEYS.path)
    topics = [part for m in messages for part in (f"{'+' if m.topic in kept else ''}/{m.topic}", m.type_name)]
    read: dict[str, Any] = {}
    with bridge() as (port, _), open_session(wire_of(port)) as session:
        publisher = session.publisher(mirror=join_ros2(session, wire_of(port), "odometry"))
        for message in messages[:2]:
            publisher.put(message)
        with again_and_again(publisher.put, messages[2:]):
            time.sleep(2.0)  # the listener joins late
            with listener("fields", *topics) as heard:
                for told in heard:
                    read[told["topic"].removeprefix("/")] = told["fields"]
                    if len(read) == len(messages):
                        break
    stamp = {"sec": AT // 10**9, "nanosec": AT % 10**9}
    assert all(read[m.topic]["header"]["stamp"] == stamp for m in messages if m.topic != KEYS.end)
    info = read[KEYS.camera_info]
    assert (info["width"], info["height"], info["d"]) == (64, 48, list(CAMERA.distortion))
    assert info["k"] == CAMERA.matrix.ravel().tolist()
    position = {"x": 0.1, "y": 0.2, "z": 0.3}
    assert read[KEYS.pose]["pose"]["position"] == position
    assert [each["pose"]["position"] for each in read[KEYS.path]["poses"]] == [position]
    odometry = read[KEYS.odom]
    assert odometry["pose"]["pose"]["position"] == position
    assert odometry["pose"]["covariance"][::7] == [1, 2, 3, 4, 5, 6]
    assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == ("odom", KEYS.frame_camera)
    depth = read[KEYS.depth]
    assert (depth["encoding"], depth["data"]["length"]) == ("16UC1", 64 * 48 * 2)
    assert depth["data"]["sum"] == 64 * 48 * (1500 // 256 + 1500 % 256)
    assert read[KEYS.color_compressed]["format"].startswith("rgb8; jpeg")
    assert read[KEYS.status]["status"][0]["message"] == "UNCERTAIN"
    assert read[KEYS.status]["status"][0]["values"] == [{"key": "fps", "value": "30"}]
    assert read[KEYS.keyframes]["width"] == 10
    assert read[KEYS.end]["data"] == "end of source"


def test_what_the_bridge_itself_publishes_does_not_come_back() -> None:
    pose = encode_pose("cam0/pose", AT, np.eye(4), "map")
    topic = ("/cam0/pose", "geometry_msgs/msg/PoseStamped")
    with bridge() as (port, end):
        with driver(port, [pose]), listener("brief", *topic) as heard:
            stamps = [told["stamp"] for told, _ in zip(heard, range(40), strict=False)]
        printed = end()
    assert len(set(stamps)) == len(stamps)
    assert "to Zenoh" not in printed


def test_cyclone_dds_reads_poses_and_transforms() -> None:
    T = np.eye(4)
    T[:3, 3] = 0.1, 0.2, 0.3
    tf = encode_tf(AT, [("odom", KEYS.frame_camera, T)])
    command = [PYTHON, str(HERE / "cyclone_listener.py"), str(DOMAIN)]
    with bridge() as (port, _), driver(port, [encode_pose("cam0/pose", AT, T, "map"), tf]):
        join = open_session(wire_of(port))
        with join as session, subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            join_ros2(session, wire_of(port), "odometry")
            try:
                assert process.stdout is not None
                read: dict[str, Any] = {}
                while len(read) < 3:
                    read.update(json.loads(process.stdout.readline()))
            finally:
                process.kill()
    assert read["pose"] == ["map", [0.1, 0.2, 0.3]]
    assert read["tf"] == [["odom", KEYS.frame_camera, [0.1, 0.2, 0.3]]]
    assert [each[:2] for each in read["tf_static"]] == [["map_upright", "map"], [KEYS.frame_camera, "cam0_link"]]


def test_transforms_have_the_name_that_ros_gives_them_on_dds_and_nothing_in_them_has_a_name_of_ros() -> None:
    """FastDDS cannot read what Cyclone DDS tells of its types, and finds none of ROS's of the same name any more."""
    program = (
        "from odom.ros2_bridge.transforms import transform_types as types\n"
        "print(*(each.__idl__.idl_transformed_typename for each in vars(types()).values()))"
    )
    done = subprocess.run([PYTHON, "-c", program], check=True, capture_output=True, text=True, cwd=HERE.parents[1])
    message, *within = done.stdout.split()
    assert message == "tf2_msgs::msg::dds_::TFMessage_"
    assert len(within) == 6
    assert all(name.startswith("odom_bridge::") for name in within)


def test_transforms_that_were_kept_are_heard_by_whoever_listens_to_a_publisher_that_is_known_already() -> None:
    """They arrive before the reader is ready: twenty times of twenty, where nobody takes them then."""
    program = (
        "import sys, time, numpy as np\n"
        "from odom.frame import Stamp\n"
        "from odom.ros2_bridge.transforms import Transforms\n"
        "from odom.wire.codec import encode_tf\n"
        "from odom.wire.ros2.qos import Qos\n"
        "told, known = (Transforms(int(sys.argv[1])) for _ in range(2))\n"
        "kept, heard = Qos(10, True, True), []\n"
        "told.offer('/tf_static', kept)\n"
        "told.publish('/tf_static', encode_tf(Stamp(1), [('a', 'b', np.eye(4))], topic='tf_static').payload)\n"
        "known.listen('/other', kept, print)\n"
        "time.sleep(2)\n"
        "for _ in range(20):\n"
        "    got, end = [], time.monotonic() + 2\n"
        "    known.listen('/tf_static', kept, got.append)\n"
        "    while not got and time.monotonic() < end: time.sleep(.01)\n"
        "    known.leave('/tf_static'); heard.append(len(got))\n"
        "print(heard == 20 * [1])"
    )
    command = [PYTHON, "-c", program, str(DOMAIN)]
    assert "True" in subprocess.run(command, check=True, capture_output=True, text=True, cwd=HERE.parents[1]).stdout


def test_nothing_is_loaded_when_a_topic_of_a_usual_type_comes() -> None:
    """It took .3 s for the first topics, for which images waited, and some were lost on the way to the bridge."""
    program = (
        "import sys\n"
        "from odom.ros2_bridge.bridge import _USUAL, Bridge\n"
        "from odom.ros2_bridge.dds import DdsNode\n"
        "from odom.wire import WireSettings\n"
        "from odom.wire.ros2.names import type_hash\n"
        "from odom.wire.ros2.qos import Qos\n"
        "from odom.wire.session import open_session\n"
        "node = DdsNode(int(sys.argv[1]))\n"
        "with open_session(WireSettings(connect=(), listen=())) as session:\n"
        "    Bridge(session, node, int(sys.argv[1]))\n"
        "    before = set(sys.modules)\n"
        "    for number, type_name in enumerate(_USUAL):\n"
        "        type_hash(type_name), node.offer(f'/topic{number}', type_name, Qos())\n"
        "    print(*(m for m in sys.modules if m not in before and '_rosidl_typesupport_' not in m))"
    )
    command = [PYTHON, "-c", program, str(DOMAIN)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=HERE.parents[1])
    assert done.stdout.split() == []


def test_only_topics_below_the_names_that_were_given_are_carried() -> None:
    pose = encode_pose("other/pose", AT, np.eye(4), "map")
    with bridge("--below", "/cam0") as (port, end):
        with driver(port, [*contract()[:-1], pose]), listener("brief", "/cam0/pose", pose.type_name) as heard:
            assert next(heard)["topic"] == "/cam0/pose"
        printed = end()
    assert "/other/pose" not in printed
    assert "/cam0/path: " in printed


def test_a_bridge_that_cannot_be_is_refused() -> None:
    command = [PYTHON, "-m", "odom", "ros2"]

    def refused(**environment: str) -> str:
        done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment}, timeout=60)
        assert done.returncode == 2
        return done.stderr

    assert "needs no bridge, see --ros2" in refused(RMW_IMPLEMENTATION="rmw_zenoh_cpp")
    assert "a ROS domain is a number from 0 to 232" in refused(ROS_DOMAIN_ID="300")


@pytest.mark.slow
@pytest.mark.wallclock
def test_images_and_odometry_at_30_hz_for_a_minute_arrive_all_and_in_time() -> None:
    seconds, rate = float(os.environ.get("ODOM_TEST_BRIDGE_SECONDS", "60")), 30
    color = raw(KEYS.color, AT, "rgb8", np.zeros((480, 640, 3), np.uint8))
    depth = encode_depth(KEYS.depth, AT, np.zeros((480, 640), np.uint16), KEYS.frame_camera)
    messages = [color, depth, contract()[4]]
    topics = [part for message in messages for part in (f"/{message.topic}", message.type_name)]
    begun, sent, stop = threading.Event(), list[int](), threading.Event()
    with bridge() as (port, end), open_session(wire_of(port)) as session, listener("brief", *topics) as heard:
        publisher = session.publisher(mirror=join_ros2(session, wire_of(port), "odometry"))

        def publish() -> None:
            due = time.monotonic()
            while not stop.is_set():
                due += 1 / rate
                time.sleep(max(0.0, due - time.monotonic()))
                for message in messages:
                    stamp = Stamp(time.time_ns())
                    if begun.is_set():
                        sent.append(stamp)
                    publisher.put(restamp(message, stamp))
                if len(sent) >= len(messages) * seconds * rate:
                    return

        thread = threading.Thread(target=publish)
        thread.start()
        arrived: dict[int, int] = {}
        seen: set[str] = set()
        for told in heard:
            seen.add(told["topic"])
            if len(seen) == len(messages):
                begun.set()
            arrived[told["stamp"]] = told["arrived"]
            if not thread.is_alive() and (arrived.keys() >= set(sent) or time.time_ns() > sent[-1] + 5 * 10**9):
                break
        stop.set()
        thread.join()
        printed = end()
    added_ms = np.array([arrived[stamp] - stamp for stamp in sent if stamp in arrived]) / 1e6
    print(
        printed,
        f"{len(sent)} sent, {len(added_ms)} arrived, ms p50, p99, most:",
        np.percentile(added_ms, [50, 99, 100]),
    )
    assert len(added_ms) == len(sent)
    assert np.percentile(added_ms, 99) <= 10
