"""A camera whose driver is on DDS as `ros2:/camera`, through `odom ros2`: nodes of rclpy and of Cyclone DDS."""

import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from play_tum import raw
from ros2_network import DOMAIN, again_and_again, driver, other_node
from test_bridge import AT, CAMERA, PYTHON, bridge, player, pytestmark  # noqa: F401  # the same are needed here

from odom.frame import Camera
from odom.wire import Message, Topics
from odom.wire.codec import decode_color, decode_depth, encode_camera_info, encode_depth, encode_tf
from odom.wire.ros2.names import Endpoint, NodeName
from odom.wire.ros2.qos import Qos
from sensors.catalogue import open_source
from sensors.source import SourceOptions

KEYS = Topics()
COLOR_FRAME, DEPTH_FRAME = "camera_color_optical_frame", "camera_depth_optical_frame"
PIXELS = np.arange(48 * 64 * 3, dtype=np.uint32).astype(np.uint8).reshape(48, 64, 3)
COLOR = [
    encode_camera_info("camera/color/camera_info", AT, CAMERA, COLOR_FRAME),
    raw("camera/color/image_raw", AT, "bgr8", PIXELS),
]
ALIGNED = raw("camera/aligned_depth_to_color/image_raw", AT, "32FC1", np.full((48, 64), 1.5, np.float32))


@contextmanager
def camera(messages: Sequence[Message]) -> Iterator[None]:
    """Publish the messages by a node of rclpy on DDS, again and again."""
    with player() as play, again_and_again(play, messages, 0.05):
        yield


def read(port: int) -> dict[str, Message]:
    """Return the first messages of colour, depth and calibration that the source gives, by topic."""
    extra = {"domain": str(DOMAIN), "start_s": "30", "router": f"tcp/127.0.0.1:{port}"}
    found: dict[str, Message] = {}
    with closing(open_source("ros2:/camera", SourceOptions(topics=KEYS, extra=tuple(extra.items())))) as source:
        for message in source.messages():
            found[message.topic] = message
            if {KEYS.camera_info, KEYS.color, KEYS.depth} <= found.keys():
                break
    return found


def test_a_camera_on_dds_is_a_source() -> None:
    with bridge() as (port, end), camera([*COLOR, ALIGNED]):
        found = read(port)
        printed = end()
    assert np.array_equal(decode_color(found[KEYS.color]), PIXELS[..., ::-1])
    assert (decode_depth(found[KEYS.depth]) == 1500).all()
    assert found[KEYS.color].payload == COLOR[1].payload
    assert "to Zenoh  /camera/color/image_raw:" in printed


def test_depth_of_its_own_camera_is_registered_by_the_tf_static_of_dds() -> None:
    small = Camera(32, 24, 25.0, 25.0, 15.5, 11.5)
    plane = np.full((24, 32), 1500, np.uint16)
    plane[:, :16] = 0
    depth = [
        encode_depth("camera/depth/image_rect_raw", AT, plane, DEPTH_FRAME),
        encode_camera_info("camera/depth/camera_info", AT, small, DEPTH_FRAME),
    ]
    # two nodes tell one transform each: .15 m to the right are 5 px of 50 px focal length at 1.5 m
    told = ["camera_link", COLOR_FRAME, "0", "camera_link", DEPTH_FRAME, "0.15"]
    talker = [PYTHON, str(Path(__file__).with_name("cyclone_talker.py")), str(DOMAIN), *told]
    # of what this project tells of its own frames, nothing may come back
    own = encode_tf(AT, [("map_upright", "map", np.eye(4))], topic="tf_static")
    with ExitStack() as stack:
        port, end = stack.enter_context(bridge())
        stack.enter_context(driver(port, [own]))
        process = stack.enter_context(subprocess.Popen(talker))
        stack.callback(process.kill)
        stack.enter_context(camera([*COLOR, *depth]))
        registered = decode_depth(read(port)[KEYS.depth])
        printed = end()
    assert registered.shape == (48, 64)
    assert 36 <= np.flatnonzero(registered[24])[0] <= 38
    assert (registered[24, 40:60] == 1500).all()
    assert "to Zenoh  /tf_static: 2 messages, 0 lost" in printed


def announced(port: int, type_name: str, type_hash: str, end: Callable[..., str], after: str) -> str:
    """Return what the bridge printed up to `after` about a node on Zenoh that publishes such a type."""
    with other_node(port) as session:
        node = NodeName(DOMAIN, str(session.zenoh.info.zid()), 0, "/", "old_camera")
        session.announce(Endpoint(node, 1, "MP", "/camera/image_raw", type_name, type_hash, Qos()).token())
        return end(after)


def test_a_type_of_another_definition_is_not_carried() -> None:
    told = "not carried: /camera/image_raw of /old_camera is of another sensor_msgs/msg/Image than ROS 2's"
    with bridge() as (port, end):
        assert "official messages" in announced(port, "sensor_msgs/msg/Image", "RIHS01_" + "0" * 64, end, told)


@pytest.mark.parametrize(
    ("type_name", "told"),
    [
        ("visualization_msgs/msg/Marker", "visualization_msgs is not installed: source ROS's setup.bash, or pip"),
        ("my_robot_msgs/msg/Arm", "topics of my_robot_msgs/msg/Arm are not carried: message type"),
    ],
)
def test_a_type_without_its_package_is_named(type_name: str, told: str) -> None:
    with bridge() as (port, end):
        printed = announced(port, type_name, "TypeHashNotSupported", end, told)
    assert printed.count(told) == 1


def test_two_cameras_on_one_topic_are_told_by_name() -> None:
    with bridge() as (_, end), camera(COLOR), camera(COLOR):
        end("2 nodes publish /camera/color/image_raw: /camera, /camera; their messages alternate")


@pytest.mark.parametrize("missing", ["rclpy", "rclpy.context"])
def test_odom_ros2_without_its_wheels_says_what_to_install(missing: str) -> None:
    program = f"import sys; sys.modules[{missing!r}] = None; from odom.__main__ import main; main()"
    done = subprocess.run([PYTHON, "-c", program, "ros2"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "odom ros2 needs rclpy: pip install 'rgbd-odom[ros2]'" in done.stderr
