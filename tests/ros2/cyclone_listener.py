"""Readers of Cyclone DDS, without anything of this project or of ROS; prints one JSON object for each message.

Argument: domain. Types within messages have names of their own, see `odom.ros2_bridge.transforms.transform_types`.
"""

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint32
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="cyclone_node::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="cyclone_node::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Point(IdlStruct, typename="cyclone_node::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Vector3(IdlStruct, typename="cyclone_node::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="cyclone_node::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="cyclone_node::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


@dataclass
class Transform(IdlStruct, typename="cyclone_node::Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="cyclone_node::TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped]


def main(domain: str) -> None:
    participant = DomainParticipant(int(domain))

    def reader(topic: str, kind: type, kept: bool) -> DataReader:
        durability = Policy.Durability.TransientLocal if kept else Policy.Durability.Volatile
        qos = Qos(durability, Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(10))
        return DataReader(participant, Topic(participant, topic, kind), qos=qos)

    poses = reader("rt/cam0/pose", PoseStamped, kept=False)
    transforms = {
        "tf": reader("rt/tf", TFMessage, kept=False),
        "tf_static": reader("rt/tf_static", TFMessage, kept=True),
    }
    while True:
        for sample in poses.take(10):
            at = sample.pose.position
            print(json.dumps({"pose": [sample.header.frame_id, [at.x, at.y, at.z]]}), flush=True)
        for name, those in transforms.items():
            for sample in those.take(10):
                moved = [
                    [t.header.frame_id, t.child_frame_id, [getattr(t.transform.translation, axis) for axis in "xyz"]]
                    for t in sample.transforms
                ]
                print(json.dumps({name: moved}), flush=True)
        time.sleep(0.05)


if __name__ == "__main__":
    main(*sys.argv[1:])
