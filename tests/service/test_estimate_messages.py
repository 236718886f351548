"""What two devices publish about their poses can stand side by side."""

import numpy as np
import pytest

from odom.backend import ChainPose, ClosedChain, Estimate, RelativePose, State, TrajectoryPose
from odom.frame import Stamp
from odom.geometry import se3
from odom.service.estimate_messages import chain_message, closed_chain_message, pose_messages
from odom.service.path_topics import PathTopics
from odom.wire import TF, Topics, codec
from odom.wire.codec import cdr

STAMP = Stamp(1_700_000_000_000_000_000)


def edges(namespace: str, x: float) -> list[tuple[str, str]]:
    """The transforms, parent and child, of a device that is `x` metres along its way."""
    T = se3.exp(np.array([x, 0.0, 0.0, 0.0, 0.0, 0.0]))
    estimate = Estimate(
        sequence=0, stamp=STAMP, state=State.TRACKING, reason="", segment=0, T_odom_camera=T, covariance=np.eye(6),
        T_map_odom=T, inliers=10, matches=20,
    )  # fmt: skip
    (tf,) = [message for message in pose_messages(Topics(namespace), estimate) if message.topic == TF]
    return [(edge.parent, edge.child) for edge in codec.decode_tf(tf)]


def test_the_default_device_has_the_frames_of_the_contract() -> None:
    assert edges("cam0", 1.0) == [("map", "odom"), ("odom", "cam0_color_optical_frame")]


def test_two_devices_share_no_frame_of_the_one_tree_of_transforms() -> None:
    first, second = edges("cam0", 1.0), edges("cam1", 2.0)
    assert second == [("cam1/map", "cam1/odom"), ("cam1/odom", "cam1/color_optical_frame")]
    assert not {frame for edge in first for frame in edge} & {frame for edge in second for frame in edge}


@pytest.mark.parametrize("heard", [(), ("cam0/odom",), ("cam0/chain", "tf"), ("cam0/odom", "cam0/pose", "tf")])
def test_only_messages_that_somebody_takes_are_made(heard: tuple[str, ...]) -> None:
    estimate = Estimate(
        sequence=1, stamp=STAMP, state=State.TRACKING, reason="", segment=0, T_odom_camera=np.eye(4),
        T_map_odom=np.eye(4), covariance=np.eye(6), chain=ChainPose(np.eye(4), np.eye(6)),
    )  # fmt: skip
    made = [
        *pose_messages(Topics("cam0"), estimate, lambda topic, type_name: topic in heard),
        chain_message(Topics("cam0"), estimate, lambda topic, type_name: topic in heard),
    ]
    assert {message.topic for message in made if message is not None} == set(heard)


def test_namespaces_of_several_parts_share_none_either() -> None:
    names = ("rig/left", "rig_left", "rig/right")
    assert len({frame for name in names for edge in edges(name, 1.0) for frame in edge}) == 3 * len(names)


def estimate_of(i: int, segment: int, path: tuple[tuple[int, int], ...] | None) -> Estimate:
    """An estimate in a segment, with a path of (frame, segment)."""
    poses = None if path is None else tuple(TrajectoryPose(Stamp(STAMP + at), np.eye(4), part) for at, part in path)
    return Estimate(i, Stamp(STAMP + i), State.TRACKING, "", segment, np.eye(4), path=poses)


def test_a_path_holds_one_joined_part_and_each_other_part_has_a_topic_and_a_frame_of_its_own() -> None:
    paths, said = PathTopics(Topics("cam0")), []
    for i, (segment, path) in enumerate(
        [
            (0, ((0, 0),)),
            (0, ((0, 0), (1, 0))),
            (1, ((0, 0), (1, 0), (2, 1))),  # lost, and begun anew
            (1, ((0, 0), (1, 0), (2, 1), (3, 1))),
            (0, None),  # back in the first segment
            (0, ((0, 0), (1, 0), (2, 0), (3, 0), (4, 0))),  # joined
        ]
    ):
        decoded = [(m.topic, codec.decode_path(m)) for m in paths.messages(estimate_of(i, segment, path))]
        said.append({topic: [pose.stamp - STAMP for pose in poses] for topic, poses in decoded})
        for topic, poses in decoded:
            assert {pose.parent for pose in poses} <= {topic.replace("cam0/path", "map").replace("/", "_")}
    assert said == [
        {"cam0/path": [0]},
        {"cam0/path": [0, 1]},
        {"cam0/path/segment_0": [0, 1], "cam0/path": [2]},
        {"cam0/path": [2, 3]},
        {"cam0/path/segment_1": [2, 3], "cam0/path/segment_0": [], "cam0/path": [0, 1]},
        {"cam0/path/segment_1": [], "cam0/path": [0, 1, 2, 3, 4]},
    ]
    assert paths.holds("cam0/path")
    assert not paths.holds("cam0/path/segment_1")


def test_of_thousands_of_parts_the_largest_are_published() -> None:
    paths = PathTopics(Topics("cam0"))
    parts = tuple((at, at // 2 if at < 10 else at) for at in range(1000))
    topics = {message.topic for message in paths.messages(estimate_of(0, 999, parts))}
    assert topics >= {"cam0/path", *(f"cam0/path/segment_{n}" for n in range(5))}
    assert len(topics) == 33


def test_the_chain_is_published_with_its_covariance_and_the_last_link_as_a_velocity() -> None:
    T, topics = se3.exp(np.array([0.1, 0.2, 0.3, 0.0, 0.1, 0.0])), Topics("cam0")
    step = np.array([0.01, 0.0, 0.02, 0.0, 0.03, 0.0])
    link = RelativePose(Stamp(STAMP - 50_000_000), se3.exp(step), 4e-6 * np.eye(6))
    estimate = Estimate(
        sequence=1, stamp=STAMP, state=State.TRACKING, reason="", segment=0, T_odom_camera=T, covariance=np.eye(6),
        T_map_odom=T, pairwise=link, chain=ChainPose(T, 1e-4 * np.eye(6)),
    )  # fmt: skip
    message = chain_message(topics, estimate)
    assert message is not None
    pose, twist = codec.decode_odometry(message), cdr.deserialise(message, cdr.ODOMETRY).twist
    np.testing.assert_allclose(pose.T_parent_child, T, atol=1e-12)
    np.testing.assert_allclose(pose.covariance, 1e-4 * np.eye(6), atol=1e-15)
    np.testing.assert_allclose([twist.twist.linear.x, twist.twist.linear.z, twist.twist.angular.y], [0.2, 0.4, 0.6])
    np.testing.assert_allclose(twist.covariance.reshape(6, 6), 1.6e-3 * np.eye(6))


def test_the_closed_chain_is_a_path() -> None:
    stamps, poses = np.array([STAMP, STAMP + 10]), np.array([np.eye(4), se3.exp(np.full(6, 0.1))])
    closed = ClosedChain(stamps, np.zeros_like(stamps), poses, poses, 1, 0, 1, None)
    path = codec.decode_path(closed_chain_message(Topics("cam0"), closed))
    assert [pose.stamp for pose in path] == stamps.tolist()
    np.testing.assert_allclose([pose.T_parent_child for pose in path], poses, atol=1e-12)
