"""A process of this project as a ROS 2 node: ROS sees what it publishes on topics of the same names."""

import logging
import threading
import time
from dataclasses import dataclass
from typing import Any

import zenoh
import zenoh.ext

from odom.errors import ConfigError, WireError
from odom.frame import Stamp
from odom.wire.delivery import encoding_of
from odom.wire.message import Message
from odom.wire.ros2.attachment import RosAttachment, gid_of
from odom.wire.ros2.names import NO_TYPE_HASH, PUBLISHER, Endpoint, Kind, NodeName, topic_name, type_hash
from odom.wire.ros2.qos import TRANSFORMS_DEPTH, Qos
from odom.wire.ros2.router_watch import RouterWatch
from odom.wire.ros2.static_frames import TF_STATIC, static_frames
from odom.wire.session import WireSession, open_session
from odom.wire.settings import ANY_LOCAL_PORT, WireSettings
from odom.wire.topics import TF, Topics

_LOG = logging.getLogger(__name__)

_HEARTBEAT_S = 0.5
"""Seconds between two heartbeats of a publisher that keeps messages for late joiners, by which they notice that they
missed one; as in rmw_zenoh."""
_ORDINARY, _KEPT, _TRANSFORMS = Qos(), Qos(depth=1, transient_local=True), Qos(TRANSFORMS_DEPTH)
"""Quality of service of ordinary messages, of those kept for late joiners, and of transforms, with the depths of ROS's
own nodes."""
_ODOMETRY = "odometry"
_MOST_PUBLISHERS = 256
"""Most topics of one node: each is a key that every router and ROS node remembers. Truth of invented bodies must not
fill their memory."""


@dataclass
class _Publisher:
    gid: bytes
    zenoh: Any
    token: Any
    sequence: int = 0

    def close(self) -> None:
        self.token.undeclare()
        self.zenoh.undeclare()


class Ros2Node:
    """Publishes messages as rmw_zenoh does, and announces itself to the ROS graph; safe to use from several threads.

    Topics are declared with their first message. Nothing here raises while messages are published: the process works
    whether or not ROS sees it.
    """

    def __init__(self, session: zenoh.Session, name: NodeName, has_type_hashes: bool = True) -> None:
        self.name = name
        self.session = session
        self._has_type_hashes = has_type_hashes
        self._lock = threading.Lock()
        self._publishers: dict[tuple[str, str], _Publisher | None] = {}
        self._entities = name.number
        self._has_depth_info = False
        self._token = session.liveliness().declare_token(name.token())

    def endpoint(self, kind: Kind, topic: str, type_name: str, qos: Qos) -> Endpoint:
        """Return a new endpoint of this node, numbered; raises WireError for a type that ROS 2 does not define."""
        hashed = type_hash(type_name) if self._has_type_hashes else NO_TYPE_HASH
        self._entities += 1
        return Endpoint(self.name, self._entities, kind, topic, type_name, hashed, qos)

    def offer(self, key: str, type_name: str, qos: Qos) -> bool:
        """Declare a topic before its first message; False when its type is not known."""
        with self._lock:
            return self._publisher(key, type_name, urgent=False, qos=qos) is not None

    def withdraw(self, key: str, type_name: str) -> None:
        """Take a topic out of the ROS graph again."""
        with self._lock:
            publisher = self._publishers.pop((key, type_name), None)
            if publisher is not None:
                publisher.close()

    def tell(self, message: Message) -> None:
        """Publish a message to ROS only."""
        with self._lock:
            self._put(message.topic, message.type_name, zenoh.ZBytes(message.payload), urgent=False)

    def put(self, message: Message, payload: zenoh.ZBytes, urgent: bool = False) -> None:
        """Publish a message whose bytes are `payload`.

        Calibration of colour stands for the depth camera, too, unless that has one of its own.
        """
        with self._lock:
            self._put(message.topic, message.type_name, payload, urgent)
            self._has_depth_info |= message.topic.endswith(_DEPTH_INFO)
            if message.topic.endswith(_COLOR_INFO) and not self._has_depth_info:
                beside = message.topic.removesuffix(_COLOR_INFO) + _DEPTH_INFO
                self._put(beside, message.type_name, payload, urgent)

    def close(self) -> None:
        """Take the node and its topics out of the ROS graph."""
        with self._lock:
            for publisher in self._publishers.values():
                if publisher is not None:
                    publisher.close()
            self._publishers.clear()
            self._token.undeclare()  # type: ignore[no-untyped-call]  # zenoh gives no type

    def _put(self, key: str, type_name: str, payload: zenoh.ZBytes, urgent: bool) -> None:
        try:
            publisher = self._publisher(key, type_name, urgent)
            if publisher is not None:
                publisher.sequence += 1
                attachment = RosAttachment(publisher.sequence, Stamp(time.time_ns()), publisher.gid)
                publisher.zenoh.put(payload, attachment=attachment.pack())
        except zenoh.ZError as error:
            _LOG.debug("%s is not published to ROS 2: %s", key, error)

    def _publisher(self, key: str, type_name: str, urgent: bool, qos: Qos | None = None) -> _Publisher | None:
        if (key, type_name) not in self._publishers and len(self._publishers) < _MOST_PUBLISHERS:
            try:
                self._publishers[key, type_name] = self._declare(key, type_name, urgent, qos or qos_of_key(key))
            except (WireError, zenoh.ZError) as error:
                _LOG.warning("%s is not published to ROS 2: %s", key, error)
                self._publishers[key, type_name] = None
        return self._publishers.get((key, type_name))

    def _declare(self, key: str, type_name: str, urgent: bool, qos: Qos) -> _Publisher:
        endpoint = self.endpoint(PUBLISHER, topic_name(key), type_name, qos)
        kept = qos.transient_local
        sporadic = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=_HEARTBEAT_S)
        publisher = zenoh.ext.declare_advanced_publisher(
            self.session,
            endpoint.key(),
            encoding=encoding_of(type_name),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA_HIGH if urgent else zenoh.Priority.DATA,
            cache=zenoh.ext.CacheConfig(max(1, qos.depth)) if kept else None,
            publisher_detection=kept,
            sample_miss_detection=sporadic if kept else None,
        )
        token = self.session.liveliness().declare_token(endpoint.token())
        return _Publisher(gid_of(endpoint.token()), publisher, token)


_COLOR_INFO, _DEPTH_INFO = "color/camera_info", "depth/camera_info"


def qos_of_key(key: str) -> Qos:
    """Return the quality of service for one of this project's keys: calibration, paths and static frames are kept."""
    if key == TF_STATIC or key.endswith("/camera_info") or "/path" in key:
        return _KEPT
    return _TRANSFORMS if key == TF else _ORDINARY


def join_ros2(session: WireSession, settings: WireSettings, role: str) -> Ros2Node | None:
    """Return the node `/<namespace>/<role>` of the domain of the settings, None when they name no domain.

    The odometry's node publishes the static frames. The node has its own session to ROS's router, which is searched for
    as long as the process lives, and ends with `session`. Raises WireError when the session cannot be opened.
    """
    if settings.ros2_domain is None:
        return None
    ros = session.enter(open_session(ros2_wire(settings)))
    watch = RouterWatch(ros.zenoh, settings.ros2_router)
    ros.at_close(watch.close)
    namespace = topic_name(Topics(settings.namespace).namespace)
    name = NodeName(settings.ros2_domain, str(ros.zenoh.info.zid()), 0, namespace, role)
    node = Ros2Node(ros.zenoh, name, settings.ros2_type_hashes)
    ros.at_close(node.close)
    if role == _ODOMETRY:
        node.tell(static_frames(Topics(settings.namespace), Stamp(time.time_ns())))
    _LOG.info("seen by ROS 2 as the node %s in domain %d", name.full_name, name.domain)
    return node


def check_no_loop(source: str, settings: WireSettings) -> None:
    """Raise ConfigError for a SOURCE `ros2:/NAME` that would listen to what `--ros2` publishes of it."""
    kind, _, prefix = source.partition(":")
    own = topic_name(Topics(settings.namespace).namespace)
    if kind == "ros2" and settings.ros2_domain is not None and f"{own}/".startswith(f"/{prefix.strip('/')}/"):
        raise ConfigError(
            f"{source} with --ros2 would publish its images below {own} again, and listen to them: give another "
            "--namespace"
        )


def ros2_wire(settings: WireSettings) -> WireSettings:
    """Return the settings of a session as rmw_zenoh opens it: a peer that finds the others through their router."""
    if not settings.ros2_router.partition("/")[2]:
        raise ConfigError(f"wire.ros2_router {settings.ros2_router!r}: give a Zenoh endpoint, as tcp/localhost:7447")
    return WireSettings(
        connect=(settings.ros2_router,),
        listen=(ANY_LOCAL_PORT,),
        drop_after_ms=settings.drop_after_ms,
        zenoh={"timestamping/enabled": True},
    )
