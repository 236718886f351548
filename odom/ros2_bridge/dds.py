"""The DDS side: a node of rclpy that publishes and receives messages as raw bytes."""

import importlib
import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from odom.errors import ConfigError
from odom.ros2_bridge.transforms import PREFIX_BYTES, Transforms, transform_types
from odom.wire.codec.cdr import TRANSFORMS
from odom.wire.ros2.qos import TRANSFORMS_DEPTH, Qos

NODE = "odom_bridge"
_IMPLEMENTATION = "RMW_IMPLEMENTATION"
_TRANSPORTS, _LARGE_MESSAGES = "FASTDDS_BUILTIN_TRANSPORTS", "DEFAULT?sockets_size=16MB"
"""Memory that FastDDS shares with readers on this machine, half of what it takes. Its own 512 KB do not hold an image:
what does not fit comes by repair, up to .3 s late. Larger: more of /dev/shm (a container has 64 MB)."""

Receive = Callable[[bytes], None]


@dataclass(frozen=True)
class DdsTopic:
    """A topic as the other DDS participants publish it, or listen to it; `nodes` are their full names.

    `type_hash` is of the first, empty where it tells none (Humble, and nodes that are not of ROS).
    """

    type_name: str
    qos: Qos
    nodes: tuple[str, ...]
    type_hash: str = ""


def ros() -> ModuleType:
    """Return rclpy; raises ConfigError with how to get it, or when the middleware of ROS is Zenoh already."""
    if "zenoh" in os.environ.get(_IMPLEMENTATION, ""):
        raise ConfigError(
            f"{_IMPLEMENTATION}={os.environ[_IMPLEMENTATION]}: ROS 2 on Zenoh needs no bridge, see --ros2"
        )
    os.environ.setdefault(_TRANSPORTS, _LARGE_MESSAGES)
    try:
        return importlib.import_module("rclpy")
    except ImportError as error:
        raise ConfigError(
            "odom ros2 needs rclpy: pip install 'rgbd-odom[ros2]' (Linux on x86-64, Python 3.11 to 3.13), or source "
            f"the setup.bash of ROS 2 ({error})"
        ) from error


@lru_cache(maxsize=256)
def message_class(type_name: str) -> Any:
    """Return the class of `sensor_msgs/msg/Image`, None where its package is not installed."""
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        return None


def can_carry(type_name: str) -> bool:
    """Whether messages of a type can be carried: its package is installed, or it is of transforms, Cyclone DDS is."""
    is_possible = type_name == TRANSFORMS and find_spec("cyclonedds") is not None
    return is_possible or message_class(type_name) is not None


def load(type_name: str) -> None:
    """Import what messages of a type need, if it is installed."""
    if message_class(type_name) is None and can_carry(type_name):
        transform_types()


class DdsNode:
    """The node `/odom_bridge` in one domain; `lost` counts gaps in the numbers of each topic's publishers."""

    def __init__(self, domain: int) -> None:
        rclpy = ros()
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self.lost: Counter[str] = Counter()
        self._transforms = Transforms(domain)
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        options = {"start_parameter_services": False, "enable_rosout": False}
        self._node = rclpy.create_node(NODE, context=self._context, **options)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._publishers: dict[str, Any] = {}
        self._subscriptions: dict[str, Any] = {}
        self._sequences: dict[bytes, int] = {}
        self._own = b""

    def published(self) -> dict[str, DdsTopic]:
        """Return what others publish, by topic; of several types on one topic the first."""
        return self._seen(self._node.get_publishers_info_by_topic)

    def wanted(self) -> dict[str, DdsTopic]:
        """Return what others listen to, by topic."""
        return self._seen(self._node.get_subscriptions_info_by_topic)

    def offer(self, topic: str, type_name: str, qos: Qos) -> None:
        """Declare a topic that will be published; does nothing for one that is."""
        if message_class(type_name) is None:
            self._transforms.offer(topic, qos)
        elif topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(message_class(type_name), topic, _profile(qos))
            self._learn_own_gid(topic)

    def withdraw(self, topic: str) -> None:
        """Publish a topic no longer."""
        self._transforms.withdraw(topic)
        if (publisher := self._publishers.pop(topic, None)) is not None:
            self._node.destroy_publisher(publisher)

    def publish(self, topic: str, payload: bytes) -> bool:
        """Send a message as it is; False for a topic that was withdrawn meanwhile."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            return self._transforms.publish(topic, payload)
        publisher.publish(payload)
        return True

    def listen(self, topic: str, type_name: str, qos: Qos, receive: Receive) -> None:
        """Call `receive` with the bytes of each message of others: from within `spin`, or from a thread of DDS."""
        if message_class(type_name) is None:
            self._transforms.listen(topic, qos, receive)
        if topic in self._subscriptions or message_class(type_name) is None:
            return

        def arrive(payload: bytes, info: dict[str, Any]) -> None:
            gid = bytes(info["publisher_gid"]["data"])
            if gid[:PREFIX_BYTES] != self._own:
                self._count(topic, gid, info["publication_sequence_number"])
                receive(payload)

        self._subscriptions[topic] = self._node.create_subscription(
            message_class(type_name), topic, arrive, _profile(qos), raw=True
        )

    def leave(self, topic: str) -> None:
        """Listen to a topic no longer."""
        self._transforms.leave(topic)
        if (subscription := self._subscriptions.pop(topic, None)) is not None:
            self._node.destroy_subscription(subscription)

    def spin(self, timeout_s: float) -> None:
        """Handle what has arrived; waits for at most `timeout_s`."""
        self._executor.spin_once(timeout_sec=timeout_s)

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def _seen(self, infos_of: Callable[[str], list[Any]]) -> dict[str, DdsTopic]:
        found: dict[str, DdsTopic] = {}
        for topic, _ in self._node.get_topic_names_and_types():
            infos = [info for info in infos_of(topic) if not self._is_bridges(info)]
            if infos:
                first = infos[0]
                names = tuple(sorted(f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos))
                hashed = str(first.topic_type_hash) if any(first.topic_type_hash.value) else ""
                found[topic] = DdsTopic(first.topic_type, _qos(first.qos_profile, first.topic_type), names, hashed)
        return found

    def _is_bridges(self, info: Any) -> bool:
        """Whether an endpoint is of a bridge, this or another: they would carry messages round and round."""
        is_own = bytes(info.endpoint_gid)[:PREFIX_BYTES] == self._transforms.gid_prefix
        return is_own or (info.node_name, info.node_namespace) == (NODE, "/")

    def _learn_own_gid(self, topic: str) -> None:
        """Remember how the gids of this node begin: it hears itself where it publishes and listens."""
        for info in self._node.get_publishers_info_by_topic(topic) if not self._own else ():
            if (info.node_name, info.node_namespace) == (NODE, "/"):
                self._own = bytes(info.endpoint_gid)[:PREFIX_BYTES]

    def _count(self, topic: str, gid: bytes, sequence: int | None) -> None:
        if sequence is not None:
            before = self._sequences.get(gid)
            if before is not None:
                self.lost[topic] += max(0, sequence - before - 1)
            self._sequences[gid] = sequence


def _profile(qos: Qos) -> Any:
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        depth=qos.depth,
        history=HistoryPolicy.KEEP_LAST if qos.depth else HistoryPolicy.KEEP_ALL,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if qos.transient_local else DurabilityPolicy.VOLATILE,
        reliability=ReliabilityPolicy.RELIABLE if qos.reliable else ReliabilityPolicy.BEST_EFFORT,
    )


def _qos(profile: Any, type_name: str) -> Qos:
    """Return what a participant says of itself; DDS does not tell the others its depth.

    Transforms have the depth that listeners to them take: many nodes tell some each.
    """
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

    kept = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    depth = TRANSFORMS_DEPTH if type_name == TRANSFORMS else Qos().depth
    return Qos(depth, kept, profile.reliability == ReliabilityPolicy.RELIABLE)
