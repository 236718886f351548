"""What two devices publish about their poses can stand side by side."""

import numpy as np

from odom.backend import Estimate, State
from odom.frame import Stamp
from odom.registration import se3
from odom.service.publication import pose_messages
from odom.wire import TF, Topics, codec

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


def test_namespaces_of_several_parts_share_none_either() -> None:
    names = ("rig/left", "rig_left", "rig/right")
    assert len({frame for name in names for edge in edges(name, 1.0) for frame in edge}) == 3 * len(names)
