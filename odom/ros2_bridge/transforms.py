"""Transforms on DDS without ROS's own package for them (tf2_msgs), which PyPI does not have: by Cyclone DDS."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from types import new_class
from typing import Any

from odom.frame import Stamp
from odom.wire.codec import cdr
from odom.wire.message import Message
from odom.wire.ros2.qos import Qos

_BLOCKING_S = 0.1
"""Longest wait for a reader that is behind, in seconds. Longer: it holds other topics back."""
_AT_ONCE = 100
"""Messages taken in one go."""
PREFIX_BYTES = 12
"""Bytes of an endpoint's gid that are those of its participant, in DDS."""


class Transforms:
    """Topics of tf2_msgs/msg/TFMessage by a participant of DDS, which joins the domain with the first of them.

    It never hears what it publishes itself. `offer` and `listen` raise ImportError without Cyclone DDS.
    """

    def __init__(self, domain: int) -> None:
        self._domain = domain
        self._writers: dict[str, Any] = {}
        self._readers: dict[str, Any] = {}

    @cached_property
    def _participant(self) -> Any:
        from cyclonedds.domain import DomainParticipant

        return DomainParticipant(self._domain)

    @cached_property
    def _guid_prefix(self) -> bytes:
        return bytes(self._participant.guid.bytes[:PREFIX_BYTES])

    @property
    def gid_prefix(self) -> bytes:
        """How the gids of what it publishes begin; empty while it publishes nothing."""
        return self._guid_prefix if self._writers else b""

    def offer(self, topic: str, qos: Qos) -> None:
        """Declare a topic that will be published; does nothing for one that is."""
        from cyclonedds.pub import DataWriter

        if topic not in self._writers:
            self._writers[topic] = DataWriter(self._participant, self._topic(topic), qos=_policies(qos))

    def withdraw(self, topic: str) -> None:
        """Publish a topic no longer."""
        self._writers.pop(topic, None)

    def publish(self, topic: str, payload: bytes) -> bool:
        """Send a message given as the bytes of its CDR; False for a topic that is not offered.

        Raises WireError for malformed bytes.
        """
        writer = self._writers.get(topic)
        if writer is None:
            return False
        decoded = cdr.deserialise(Message("tf", cdr.TRANSFORMS, Stamp(0), payload), cdr.TRANSFORMS)
        types = transform_types()
        writer.write(types.message([types.of(each) for each in decoded.transforms]))
        return True

    def listen(self, topic: str, qos: Qos, receive: Callable[[bytes], None]) -> None:
        """Call `receive` with the bytes of each message of others; once a topic.

        It is called from a thread of DDS, and from this one for what was kept by publishers that are known already:
        that arrives before Cyclone DDS has a name for the reader.
        """
        from cyclonedds.core import Listener
        from cyclonedds.sub import DataReader

        if topic in self._readers:
            return
        message_type = transform_types().message

        def take(reader: Any) -> None:
            while samples := reader.take(_AT_ONCE):
                for sample in samples:
                    if isinstance(sample, message_type):  # and no notice that a publisher has gone
                        receive(sample.serialize(use_version_2=False))

        class Arrivals(Listener):  # type: ignore[misc]  # Cyclone DDS gives no types
            def on_data_available(self, reader: Any) -> None:
                if reader is not None:
                    take(reader)

        reader = DataReader(self._participant, self._topic(topic), qos=_policies(qos, reads=True), listener=Arrivals())
        self._readers[topic] = reader
        take(reader)

    def leave(self, topic: str) -> None:
        """Listen to a topic no longer."""
        self._readers.pop(topic, None)

    def _topic(self, name: str) -> Any:
        from cyclonedds.topic import Topic

        return Topic(self._participant, f"rt{name}", transform_types().message)


def _policies(qos: Qos, reads: bool = False) -> Any:
    from cyclonedds.core import Policy
    from cyclonedds.core import Qos as DdsQos
    from cyclonedds.util import duration

    durability, reliability = Policy.Durability, Policy.Reliability
    return DdsQos(
        durability.TransientLocal if qos.transient_local else durability.Volatile,
        reliability.Reliable(duration(seconds=_BLOCKING_S)) if qos.reliable or not reads else reliability.BestEffort,
        Policy.History.KeepLast(max(1, qos.depth)),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.IgnoreLocal.Participant,
    )


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
    """Return the types: the message is named as ROS 2 names it on DDS, what is in it has names of its own.

    The first call takes some tenths of a second: all that Cyclone DDS makes of them is made now.

    Cyclone DDS for Python tells the other participants of its types, and FastDDS cannot read what it tells. It then
    waits for ever for a type of that name, also where others tell it: with ROS's own names no topic whose messages have
    a header would be discovered any more.
    """
    from cyclonedds.idl import IdlStruct, types

    def struct(name: str, fields: dict[str, Any], typename: str = "") -> Any:
        named = {"typename": typename or f"odom_bridge::{name}"}
        return dataclass(new_class(name, (IdlStruct,), named, lambda body: body.update(__annotations__=fields)))

    number = types.float64
    time = struct("Time", {"sec": types.int32, "nanosec": types.uint32})
    header = struct("Header", {"stamp": time, "frame_id": str})
    vector = struct("Vector3", dict.fromkeys("xyz", number))
    quaternion = struct("Quaternion", dict.fromkeys("xyzw", number))
    transform = struct("Transform", {"translation": vector, "rotation": quaternion})
    stamped = struct("TransformStamped", {"header": header, "child_frame_id": str, "transform": transform})
    message = struct("TFMessage", {"transforms": types.sequence[stamped]}, "tf2_msgs::msg::dds_::TFMessage_")
    message.__idl__.fill_type_data()
    return TransformTypes(message, stamped, transform, header, time, vector, quaternion)
