"""Names of ROS 2 as rmw_zenoh writes them: keys of the data, and liveliness tokens that make up the ROS graph.

Source: the design document of rmw_zenoh_cpp (docs/design.md in github.com/ros2/rmw_zenoh).
"""

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from odom.errors import WireError
from odom.wire.codec.cdr import typestore
from odom.wire.ros2.qos import Qos, qos_of

Kind = Literal["MP", "MS"]
"""What an endpoint is: a publisher or a subscriber of messages."""

PUBLISHER: Kind = "MP"
SUBSCRIBER: Kind = "MS"
NO_TYPE_HASH = "TypeHashNotSupported"
"""What stands for the hash of a type in ROS 2 Humble, which knows none."""

_ADMIN = "@ros2_lv"
_NODE = "NN"
_ENCLAVE = "%"
_TYPE = re.compile(r"([A-Za-z]\w*)/msg/([A-Za-z]\w*)\Z", re.ASCII)
_DDS_TYPE = re.compile(r"([A-Za-z]\w*)::msg::dds_::([A-Za-z]\w*)_\Z", re.ASCII)


@dataclass(frozen=True)
class NodeName:
    """A node in the graph of a domain: `session` is its Zenoh session's id, `number` is its own within that."""

    domain: int
    session: str
    number: int
    namespace: str
    name: str

    @property
    def full_name(self) -> str:
        """Name below its namespace, such as `/cam0/odometry`."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    def token(self) -> str:
        """Return the liveliness token by which the others see the node."""
        return f"{self._begin(self.number, _NODE)}"

    def _begin(self, number: int, kind: str) -> str:
        parts = (_ADMIN, self.domain, self.session, self.number, number, kind, _ENCLAVE)
        return "/".join((*map(str, parts), _mangled(self.namespace), self.name))


@dataclass(frozen=True)
class Endpoint:
    """A publisher or subscriber of a node: `topic` begins with a slash, `type_name` is as `sensor_msgs/msg/Image`."""

    node: NodeName
    number: int
    kind: Kind
    topic: str
    type_name: str
    type_hash: str
    qos: Qos

    def token(self) -> str:
        """Return the liveliness token by which the others see the endpoint."""
        of_node = self.node._begin(self.number, self.kind)
        return "/".join((of_node, _mangled(self.topic), dds_type(self.type_name), self.type_hash, self.qos.token()))

    def key(self) -> str:
        """Return the key of its messages."""
        return data_key(self.node.domain, self.topic, self.type_name, self.type_hash)


def topic_name(key: str) -> str:
    """Return the ROS topic of one of this project's keys: with a slash before, and no part that begins with a digit."""
    return "".join(f"/{'n' if part[:1].isdigit() else ''}{part}" for part in key.split("/"))


def data_key(domain: int, topic: str, type_name: str, type_hash: str) -> str:
    """Return the key of the messages of a topic; raises WireError for what is no message type."""
    return f"{domain}/{topic.strip('/')}/{dds_type(type_name)}/{type_hash}"


def endpoints_of(domain: int, kind: Kind) -> str:
    """Return the key expression of the tokens of all publishers or subscribers of a domain."""
    return f"{_ADMIN}/{domain}/*/*/*/{kind}/**"


def endpoint_of(token: str) -> Endpoint | None:
    """Return the endpoint that a token tells of, None when it is no message's or cannot be read."""
    parts = token.split("/")
    if len(parts) != 13 or parts[0] != _ADMIN or parts[5] not in (PUBLISHER, SUBSCRIBER):
        return None
    _, domain, session, node, number, kind, _, namespace, name, topic, dds, type_hash, qos = parts
    type_name = ros_type(dds)
    if type_name is None or not (domain.isdecimal() and node.isdecimal() and number.isdecimal()):
        return None
    owner = NodeName(int(domain), session, int(node), namespace.replace("%", "/"), name)
    kind_of_it = PUBLISHER if kind == PUBLISHER else SUBSCRIBER
    return Endpoint(owner, int(number), kind_of_it, topic.replace("%", "/"), type_name, type_hash, qos_of(qos))


def dds_type(type_name: str) -> str:
    """Return `sensor_msgs::msg::dds_::Image_` for `sensor_msgs/msg/Image`; raises WireError for no such name."""
    found = _TYPE.match(type_name)
    if found is None:
        raise WireError(f"{type_name!r} is no message type of ROS 2: it has the form package/msg/Name")
    return f"{found[1]}::msg::dds_::{found[2]}_"


def ros_type(dds: str) -> str | None:
    """Return `sensor_msgs/msg/Image` for `sensor_msgs::msg::dds_::Image_`, None for anything else."""
    found = _DDS_TYPE.match(dds)
    return None if found is None else f"{found[1]}/msg/{found[2]}"


@lru_cache(maxsize=64)
def type_hash(type_name: str) -> str:
    """Return the hash of a type's definition, `RIHS01_...`; raises WireError for a type that ROS 2 does not define."""
    try:
        return str(typestore(type_name).hash_rihs01(type_name))
    except KeyError:
        raise WireError(f"message type {type_name!r} is not known") from None


def _mangled(name: str) -> str:
    return name.replace("/", "%") or "%"
