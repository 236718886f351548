import logging
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import zenoh
import zenoh.ext
from ros2_network import DOMAIN, again_and_again, free_port, listener, other_node, router, tokens, wire_of

from odom.frame import Camera, Stamp
from odom.wire import Message, Topics
from odom.wire.codec import (
    decode_tf,
    encode_camera_info,
    encode_depth,
    encode_odometry,
    encode_path,
    encode_pose,
    encode_tf,
)
from odom.wire.ros2 import Ros2Node, join_ros2, static_frames
from odom.wire.ros2.attachment import gid_of, ros_attachment_of
from odom.wire.ros2.graph import RosGraph
from odom.wire.ros2.inbox import Inbox
from odom.wire.ros2.names import Endpoint, NodeName, endpoint_of
from odom.wire.ros2.static_frames import TF_STATIC
from odom.wire.session import WireSession, open_session

KEYS = Topics()
CAMERA = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
BEGIN = 1_700_000_000_000_000_000
CALIBRATION = encode_camera_info(KEYS.camera_info, Stamp(BEGIN), CAMERA)


def published(session: WireSession, port: int, messages: list[Message], **changes: object) -> None:
    wire = wire_of(port, **changes)
    publisher = session.publisher(mirror=join_ros2(session, wire, "odometry"))
    for message in messages:
        publisher.put(message)


def results() -> list[Message]:
    T, covariance = np.eye(4), np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    T[:3, 3] = 0.1, 0.2, 0.3
    at = Stamp(BEGIN)
    return [
        encode_path(KEYS.path, at, [(at, T)], "map"),
        encode_odometry(KEYS.odom, at, T, covariance, "odom", KEYS.frame_camera),
        static_frames(KEYS, at),
    ]


def test_a_foreign_subscriber_reads_images_and_odometry(port: int) -> None:
    topics = ("/cam0/odom", "nav_msgs/msg/Odometry", "/cam0/depth/image_raw", "sensor_msgs/msg/Image")
    with open_session(wire_of(port)) as session, listener(port, *topics) as heard:
        publisher = session.publisher(mirror=join_ros2(session, wire_of(port), "odometry"))
        odometry, depth = results()[1], encode_depth(KEYS.depth, Stamp(BEGIN), np.zeros((48, 64), np.uint16))
        found: dict[str, dict[str, Any]] = {}
        with again_and_again(publisher.put, [odometry, depth]):
            while len(found) < 2:
                told = next(heard)
                found[told["topic"]] = told
    assert found["/cam0/odom"]["frame"] == "odom"
    assert found["/cam0/odom"]["stamp"] == BEGIN
    assert found["/cam0/odom"]["position"] == [0.1, 0.2, 0.3]
    assert np.diag(np.reshape(found["/cam0/odom"]["covariance"], (6, 6))).tolist() == [1, 2, 3, 4, 5, 6]
    assert found["/cam0/depth/image_raw"]["bytes"] == 48 * 64 * 2


def test_a_late_foreign_subscriber_gets_the_static_frames(port: int) -> None:
    with open_session(wire_of(port)) as session:
        published(session, port, results())
        # it looks for what was kept under topics without a slash inside only
        with listener(port, "+/tf_static", "tf2_msgs/msg/TFMessage") as heard:
            told = next(heard)
    assert (told["topic"], told["frame"]) == ("/tf_static", "map_upright")


def test_a_late_subscriber_as_rmw_zenoh_declares_it_gets_calibration_path_and_static_frames(port: int) -> None:
    kept = {"color/camera_info", "depth/camera_info", "path", "tf_static"}
    with open_session(wire_of(port)) as session, other_node(port) as other:
        published(session, port, [CALIBRATION, *results()])
        graph(other, 6)
        heard: list[str] = []
        late = zenoh.ext.declare_advanced_subscriber(
            other.zenoh,
            f"{DOMAIN}/**",
            lambda sample: heard.append(str(sample.key_expr)),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=10),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
            subscriber_detection=True,
        )
        wait_for(lambda: len(heard) >= len(kept))
        late.undeclare()
    assert {
        key.removeprefix(f"{DOMAIN}/").removeprefix("cam0/").rpartition("/")[0].rpartition("/")[0] for key in heard
    } == kept


def test_the_graph_shows_node_and_topics_until_the_process_ends(port: int) -> None:
    with other_node(port) as other:
        with open_session(wire_of(port)) as session:
            published(session, port, results())
            endpoints = graph(other, 4)
        wait_for(lambda: not tokens(other))
    assert {(endpoint.topic, endpoint.node.full_name) for endpoint in endpoints} == {
        (topic, "/cam0/odometry") for topic in ("/cam0/path", "/cam0/odom", "/tf_static")
    }
    numbers = [endpoint.number for endpoint in endpoints]
    assert len(set(numbers)) == 3
    assert 0 not in numbers


def test_messages_are_numbered_from_one_and_carry_the_publishers_gid(port: int) -> None:
    pose = encode_pose(KEYS.pose, Stamp(BEGIN), np.eye(4), "map")
    with other_node(port) as other, open_session(wire_of(port)) as session:
        heard = other.zenoh.declare_subscriber(f"{DOMAIN}/cam0/pose/**")
        publisher = session.publisher(mirror=join_ros2(session, wire_of(port), "odometry"))
        graph(other, 2)
        samples = []
        while len(samples) < 3:
            publisher.put(pose)
            time.sleep(0.05)
            while (sample := heard.try_recv()) is not None:
                samples.append(sample)
        token = next(endpoint.token() for endpoint in graph(other, 3) if endpoint.topic == "/cam0/pose")
    read = [ros_attachment_of(sample.attachment.to_bytes()) for sample in samples]
    sequences = [attachment.sequence for attachment in read if attachment is not None]
    assert sequences == list(range(sequences[0], sequences[0] + len(read)))
    assert {attachment.gid for attachment in read if attachment is not None} == {gid_of(token)}
    assert all(sample.payload.to_bytes() == pose.payload for sample in samples)


def test_for_humble_no_hash_stands_in_the_keys(port: int) -> None:
    with other_node(port) as other, open_session(wire_of(port)) as session:
        published(session, port, results(), ros2_type_hashes=False)
        endpoints = graph(other, 4)
    assert {endpoint.type_hash for endpoint in endpoints} == {"TypeHashNotSupported"}


def test_without_a_router_it_is_told_once_and_work_goes_on_until_one_comes(caplog: pytest.LogCaptureFixture) -> None:
    port = free_port()
    with caplog.at_level(logging.INFO), open_session(wire_of(port)) as session:
        published(session, port, results())
        wait_for(lambda: "no ROS 2 router answers at" in caplog.text)
        with router(port), other_node(port) as other:
            wait_for(lambda: "has come" in caplog.text)
            graph(other, 4)
    assert caplog.text.count("no ROS 2 router answers at") == 1
    assert "rmw_zenohd" in caplog.text


def test_a_type_that_ros_does_not_define_is_told_once_and_the_rest_is_published(
    port: int, caplog: pytest.LogCaptureFixture
) -> None:
    strange = Message("cam0/strange", "made_up/msg/Thing", Stamp(0), b"\0\1\0\0")
    with other_node(port) as other, open_session(wire_of(port)) as session:
        published(session, port, [strange, *results(), strange])
        graph(other, 4)
    assert caplog.text.count("cam0/strange is not published to ROS 2") == 1


def graph(other: WireSession, size: int) -> list[Endpoint]:
    """Return the endpoints of the graph once it has `size` tokens."""
    deadline = time.monotonic() + 15
    while len(found := tokens(other)) != size:
        assert time.monotonic() < deadline, found
        time.sleep(0.05)
    return [endpoint for endpoint in map(endpoint_of, found) if endpoint is not None]


def wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 15
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.05)


def test_the_static_transforms_of_many_nodes_wait_where_few_images_may(port: int) -> None:
    def told(name: str) -> Message:
        return encode_tf(Stamp(BEGIN), [("base", name, np.eye(4))], topic=TF_STATIC)

    names = [f"part{i}" for i in range(8)]
    with other_node(port) as theirs, other_node(port) as mine:
        zid = str(theirs.zenoh.info.zid())
        robots = [Ros2Node(theirs.zenoh, NodeName(DOMAIN, zid, 100 * i, "/", name)) for i, name in enumerate(names)]
        for robot, name in zip(robots, names, strict=True):
            robot.tell(told(name))
        graph, inbox = RosGraph(mine, DOMAIN), Inbox(node_of(mine), 2)
        wait_for(lambda: len(graph.endpoints().get("/tf_static", ())) == 8)
        inbox.subscribe(graph.endpoints()["/tf_static"][0])
        wait_for(lambda: inbox.counts["received"] == 8)
        waiting = filter(None, [inbox.receive(0.0) for _ in names])
        assert {each.child for message in waiting for each in decode_tf(message)} == set(names)
        assert inbox.counts["dropped"] == 0
        inbox.close()
        for robot in robots:
            robot.close()


def node_of(session: WireSession) -> Ros2Node:
    return Ros2Node(session.zenoh, NodeName(DOMAIN, str(session.zenoh.info.zid()), 0, "/", "listener"))
