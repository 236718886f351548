"""Transforms on DDS without ROS's own package for them (tf2_msgs), which PyPI does not have: by Cyclone DDS."""

from dataclasses import dataclass
from functools import lru_cache
from types import new_class
from typing import Any

from odom.frame import Stamp
from odom.wire.codec import cdr
from odom.wire.message import Message
from odom.wire.ros2.qos import Qos

_BLOCKING_S = 0.1
"""Longest wait for a reader that is behind, in seconds. Longer: it holds other topics back."""


class TransformWriter:
    """Publishes one topic of tf2_msgs/msg/TFMessage; raises ImportError when Cyclone DDS is not installed."""

    def __init__(self, domain: int, topic: str, qos: Qos) -> None:
        from cyclonedds.core import Policy
        from cyclonedds.core import Qos as DdsQos
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic
        from cyclonedds.util import duration

        kept = Policy.Durability.TransientLocal if qos.transient_local else Policy.Durability.Volatile
        policies = DdsQos(
            kept,
            Policy.Reliability.Reliable(duration(seconds=_BLOCKING_S)),
            Policy.History.KeepLast(max(1, qos.depth)),
            Policy.DataRepresentation(use_cdrv0_representation=True),
        )
        participant = DomainParticipant(domain)
        self._types = transform_types()
        self._writer = DataWriter(participant, Topic(participant, f"rt{topic}", self._types.message), qos=policies)

    def publish(self, payload: bytes) -> None:
        """Send a message that is given as the bytes of its CDR; raises WireError for malformed ones."""
        decoded = cdr.deserialise(Message("tf", cdr.TRANSFORMS, Stamp(0), payload), cdr.TRANSFORMS)
        self._writer.write(self._types.message([self._types.of(each) for each in decoded.transforms]))


@dataclass(frozen=True)
class TransformTypes:
    """The types of DDS that stand for TFMessage and what is in it."""

    message: Any
    stamped: Any
    transform: Any
    header: Any
    time: Any
    vector: Any
    quaternion: Any

    def of(self, stamped: Any) -> Any:
        """Return a `rosbags` TransformStamped as DDS writes it."""
        at, turn = stamped.transform.translation, stamped.transform.rotation
        header = self.header(self.time(stamped.header.stamp.sec, stamped.header.stamp.nanosec), stamped.header.frame_id)
        moved = self.transform(self.vector(at.x, at.y, at.z), self.quaternion(turn.x, turn.y, turn.z, turn.w))
        return self.stamped(header, stamped.child_frame_id, moved)


@lru_cache(maxsize=1)
def transform_types() -> TransformTypes:
    """Return the types, named as ROS 2 names them on DDS."""
    from cyclonedds.idl import IdlStruct, types

    def struct(package: str, name: str, fields: dict[str, Any]) -> Any:
        named = {"typename": f"{package}::msg::dds_::{name}_"}
        return dataclass(new_class(name, (IdlStruct,), named, lambda body: body.update(__annotations__=fields)))

    number = types.float64
    time = struct("builtin_interfaces", "Time", {"sec": types.int32, "nanosec": types.uint32})
    header = struct("std_msgs", "Header", {"stamp": time, "frame_id": str})
    vector = struct("geometry_msgs", "Vector3", dict.fromkeys("xyz", number))
    quaternion = struct("geometry_msgs", "Quaternion", dict.fromkeys("xyzw", number))
    transform = struct("geometry_msgs", "Transform", {"translation": vector, "rotation": quaternion})
    stamped = struct(
        "geometry_msgs", "TransformStamped", {"header": header, "child_frame_id": str, "transform": transform}
    )
    message = struct("tf2_msgs", "TFMessage", {"transforms": types.sequence[stamped]})
    return TransformTypes(message, stamped, transform, header, time, vector, quaternion)
