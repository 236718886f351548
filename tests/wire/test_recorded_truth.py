"""True poses in recordings of others: which topics can be named for them, and that a run without truth says so."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_messages import BEGIN, PERIOD_NS
from test_foreign_bags import FRAMES, realsense, record

from odom import read_recording
from odom.cli.trajectories import read_truth
from odom.errors import ConfigError
from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.wire import Message, Topics, truth
from odom.wire.codec import cdr, decode_pose, encode_odometry, encode_path, encode_pose, encode_tf
from odom.wire.codec.poses import _pose
from sensors.catalogue import open_source
from sensors.source import SourceOptions

Encode = Callable[[str, Stamp, Array], Message]


def pose(i: int) -> Array:
    T = np.eye(4)
    T[:2, :2] = [[np.cos(0.1 * i), -np.sin(0.1 * i)], [np.sin(0.1 * i), np.cos(0.1 * i)]]
    T[:3, 3] = 0.1 * i, 2.0, 3.0
    return T


def odometry(topic: str, stamp: Stamp, T: Array) -> Message:
    return encode_odometry(topic, stamp, T, np.eye(6), "world", "base_link")


def with_covariance(topic: str, stamp: Stamp, T: Array) -> Message:
    content = cdr.build("geometry_msgs/msg/PoseWithCovariance", pose=_pose(T), covariance=np.full(36, np.nan))
    return cdr.encode(topic, "geometry_msgs/msg/PoseWithCovarianceStamped", stamp, "world", pose=content)


def transform(topic: str, stamp: Stamp, T: Array) -> Message:
    (edge,) = cdr.deserialise(encode_tf(stamp, [("world", "base_link", T)]), cdr.TRANSFORMS).transforms
    return cdr.serialise(topic, "geometry_msgs/msg/TransformStamped", stamp, edge)


def bare(topic: str, stamp: Stamp, T: Array) -> Message:
    return encode_pose(topic, stamp, T, "world")


def stamps() -> list[Stamp]:
    return [Stamp(BEGIN + i * PERIOD_NS + 3_000_000) for i in range(FRAMES)]


def with_poses(encode: Encode, topic: str) -> list[Message]:
    images = [message for message in realsense() if message.type_name != cdr.POSE]
    return [*images, *(encode(topic, stamp, pose(i)) for i, stamp in enumerate(stamps()))]


@pytest.mark.parametrize(
    ("topic", "body"),
    [
        ("vicon/helmet/odom", "helmet"),
        ("vicon/rig/rig", "rig"),
        ("ground_truth/pose", "ground_truth"),
        ("odom", "body"),
    ],
)
@pytest.mark.parametrize("encode", [odometry, with_covariance, transform])
def test_named_poses_of_every_kind_are_truth(tmp_path: Path, encode: Encode, topic: str, body: str) -> None:
    bag = record(tmp_path / "bag", with_poses(encode, topic))
    for spec in (bag, *bag.glob("*.mcap")):
        source = open_source(str(spec), SourceOptions(topics_from=(("truth", f"/{topic}"),)))
        found = [message for message in source.messages() if message.topic == f"truth/{body}/pose"]
        assert [message.stamp for message in found] == [decode_pose(message).stamp for message in found] == stamps()
        for i, message in enumerate(found):
            assert np.allclose(decode_pose(message).T_parent_child, pose(i), atol=1e-9)


def test_a_named_pose_that_is_none_is_left_out_and_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    messages = with_poses(odometry, "rig/odom")
    for k in (-1, -2):
        messages[k] = replace(messages[k], payload=messages[k].payload[:60])
    bag = record(tmp_path / "bag", messages)
    source = open_source(str(bag), SourceOptions(topics_from=(("truth", "/rig/odom"),)))
    assert [m.topic for m in source.messages()].count("truth/rig/pose") == FRAMES - 2
    assert "2 poses of /rig/odom are left out, such as: rig/odom: malformed" in caplog.text


def test_a_true_pose_that_is_none_ends_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    messages = with_poses(bare, truth("rig"))
    messages[-1] = replace(messages[-1], payload=messages[-1].payload[:-32] + bytes(32))
    bag = record(tmp_path / "bag", messages)
    source = open_source(str(bag), SourceOptions())
    assert [m.topic for m in source.messages()].count(truth("rig")) == FRAMES - 1
    assert "1 poses of /truth/rig/pose are left out" in caplog.text
    caplog.clear()
    assert len(read_recording(bag).truth()["rig"]) == FRAMES - 1
    assert "1 true poses are left out" in caplog.text


@pytest.mark.parametrize("encode", [odometry, with_covariance, transform, bare])
def test_a_recording_without_truth_says_which_poses_could_be_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, encode: Encode
) -> None:
    caplog.set_level("INFO")
    bag = record(tmp_path / "bag", with_poses(encode, "vicon/helmet"))
    open_source(str(bag), SourceOptions())
    assert "if the truth is among them, give --topic truth=/vicon/helmet" in caplog.text
    caplog.clear()
    open_source(str(bag), SourceOptions(topics_from=(("truth", "/vicon/helmet"),)))
    assert "if the truth is among them" not in caplog.text


def test_motion_capture_is_named_before_other_poses(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    messages = [*with_poses(odometry, "a/wheels"), *(transform("mocap/rig", stamp, pose(0)) for stamp in stamps())]
    open_source(str(record(tmp_path / "bag", messages)), SourceOptions())
    assert "give --topic truth=/mocap/rig" in caplog.text
    assert "/a/wheels (nav_msgs/msg/Odometry)" in caplog.text


def test_poses_that_the_odometry_itself_recorded_are_not_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    topics = Topics("cam0")
    images = [
        replace(message, topic=message.topic.replace("camera/color", "cam0/color"))
        for message in realsense()
        if message.topic.startswith(("camera/color", "camera/aligned"))
    ]
    own = [odometry(topics.odom, stamp, pose(0)) for stamp in stamps()]
    own += [encode_pose(topics.pose, stamp, pose(0), "map") for stamp in stamps()]
    open_source(str(record(tmp_path / "bag", [*images, *own])), SourceOptions())
    assert "truth none" in caplog.text
    assert "if the truth is among them" not in caplog.text


def test_what_holds_several_poses_a_message_is_refused_as_truth_with_what_can_be_named(tmp_path: Path) -> None:
    path = [encode_path("rig/path", stamp, [(stamp, pose(0))], "world") for stamp in stamps()]
    bag = record(tmp_path / "bag", [*with_poses(odometry, "rig/odom"), *path])
    with pytest.raises(ConfigError, match=r"give one of the recording's poses; these are: /rig/odom \(nav_msgs"):
        open_source(str(bag), SourceOptions(topics_from=(("truth", "/rig/path"),)))


@pytest.mark.parametrize("encode", [odometry, with_covariance, transform, bare])
def test_a_trajectory_can_be_judged_by_poses_of_every_kind(tmp_path: Path, encode: Encode) -> None:
    bag = record(tmp_path / "bag", with_poses(encode, "vicon/helmet"))
    true, _ = read_truth(bag, times=None, topic="/vicon/helmet", body=None, y_up=True, of_run=False)
    assert true.stamps.tolist() == stamps()
    assert np.allclose(true.T_world_body, [pose(i) for i in range(FRAMES)], atol=1e-9)


def test_what_is_no_pose_is_left_out_of_the_truth_and_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    messages = with_poses(transform, "vicon/helmet")
    messages[-1] = replace(messages[-1], payload=messages[-1].payload[:60])
    bag = record(tmp_path / "bag", messages)
    true, _ = read_truth(bag, times=None, topic="vicon/helmet", body=None, y_up=True, of_run=False)
    assert true.stamps.tolist() == stamps()[:-1]
    assert "1 messages of /vicon/helmet are left out, such as: vicon/helmet: malformed" in caplog.text
