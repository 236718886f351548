"""Which topics go in which direction: each is offered on the other side, and forwarded while it has subscribers."""

import logging
import sys
import threading
import time
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from odom.errors import WireError
from odom.frame import Stamp
from odom.ros2_bridge.dds import NODE, DdsNode, DdsTopic, can_carry, load
from odom.wire.codec.cdr import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    DIAGNOSTICS,
    IMAGE,
    ODOMETRY,
    PATH,
    POINT_CLOUD,
    POSE,
    STRING,
    TRANSFORMS,
)
from odom.wire.message import Message
from odom.wire.ros2.graph import RosGraph, several, strange_type
from odom.wire.ros2.inbox import Inbox
from odom.wire.ros2.names import SUBSCRIBER, Endpoint, NodeName, type_hash
from odom.wire.ros2.node import Ros2Node
from odom.wire.session import WireSession

_LOG = logging.getLogger(__name__)
_LOOK_S = 0.25
"""Seconds between two looks at both graphs. Shorter: more time for nothing; longer: who comes gets messages later."""
_SPIN_S = 0.05
"""Longest wait for a message of DDS before anything else is looked at. Chosen by hand."""
_SWITCH_S = 0.0005
"""Seconds for which a thread may keep the interpreter while others wait for it. Python's own 5 ms: an image that comes
while both graphs are looked at waits for so long; shorter: more switches, nothing else."""
_DEPTH = 10
"""Messages of a topic that may wait for DDS; the newest win. Larger: a stall costs more memory (9 MB at 10 images);
smaller: a short stall loses messages."""
_OF_EVERY_NODE = ("/rosout", "/parameter_events")
"""Topics of ROS itself, which every node of both sides has."""
_OF_ONE_CAMERA = (IMAGE, COMPRESSED_IMAGE, CAMERA_INFO)
"""Types of topics that several nodes publish by mistake only."""
_USUAL = (*_OF_ONE_CAMERA, DIAGNOSTICS, ODOMETRY, PATH, POINT_CLOUD, POSE, STRING, TRANSFORMS)
"""Types that are loaded at the start: it takes .3 s, for which whatever is carried by then would wait."""


@dataclass
class Traffic:
    """Messages that went to one side, by topic."""

    carried: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)


class Bridge:
    """Joins one domain of both sides. `below`: names that the topics must begin with, all if there are none.

    What the bridge itself publishes on a side is never taken from there again.
    """

    def __init__(self, session: WireSession, dds: DdsNode, domain: int, below: Collection[str] = ()) -> None:
        self.to_dds, self.to_zenoh = Traffic(), Traffic()
        for type_name in _USUAL:
            type_hash(type_name)
            load(type_name)
        self._dds = dds
        self._below = tuple("/" + name.strip("/") + "/" for name in below)
        self._node = Ros2Node(session.zenoh, NodeName(domain, str(session.zenoh.info.zid()), 0, "/", NODE))
        session.at_close(self._node.close)
        self._published = RosGraph(session, domain)
        self._wanted = RosGraph(session, domain, SUBSCRIBER)
        self.inbox = Inbox(self._node, _DEPTH)
        session.at_close(self.inbox.close)
        self._offered: dict[str, str] = {}
        self._told: set[str] = set()
        self._to_dds: set[str] = set()

    def run(self, stop: threading.Event) -> None:
        """Carry messages until `stop` is set."""
        sys.setswitchinterval(_SWITCH_S)
        carrier = threading.Thread(target=self._carry_to_dds, args=(stop,), name="to dds")
        carrier.start()
        due = 0.0
        try:
            while not stop.is_set():
                if time.monotonic() >= due:
                    self._look()
                    due = time.monotonic() + _LOOK_S
                self._dds.spin(_SPIN_S)
        finally:
            stop.set()
            carrier.join()
            for topic in self._offered:
                self._dds.leave(topic)

    @property
    def lost(self) -> Counter[str]:
        """Messages that did not get across, by topic and for any reason."""
        return self._dds.lost + self.to_dds.refused + self.to_zenoh.refused

    def _look(self) -> None:
        on_zenoh = {topic: _others(ends) for topic, ends in self._published.endpoints().items()}
        wanted_on_zenoh = {topic for topic, ends in self._wanted.endpoints().items() if _others(ends)}
        on_dds, wanted_on_dds = self._dds.published(), self._dds.wanted()
        self._offer_to_dds({t: ends for t, ends in on_zenoh.items() if ends and self._is_bridged(t)}, wanted_on_dds)
        self._offer_to_zenoh({t: seen for t, seen in on_dds.items() if self._is_bridged(t)}, wanted_on_zenoh)

    def _offer_to_dds(self, topics: dict[str, list[Endpoint]], wanted: Collection[str]) -> None:
        for gone in self._to_dds - topics.keys():
            self.inbox.unsubscribe(gone)
            self._dds.withdraw(gone)
        self._to_dds &= topics.keys()
        for topic, endpoints in topics.items():
            endpoint, nodes = endpoints[0], [each.node.full_name for each in endpoints]
            if not self._can_carry(topic, endpoint.type_name, nodes, endpoint.type_hash):
                continue
            self._dds.offer(topic, endpoint.type_name, endpoint.qos)
            self._to_dds.add(topic)
            if topic in wanted or endpoint.qos.transient_local:
                self.inbox.subscribe(endpoint)
            else:
                self.inbox.unsubscribe(topic)

    def _offer_to_zenoh(self, topics: dict[str, DdsTopic], wanted: Collection[str]) -> None:
        for gone in self._offered.keys() - topics.keys():
            self._dds.leave(gone)
            self._node.withdraw(gone.removeprefix("/"), self._offered.pop(gone))
        for topic, seen in topics.items():
            if not self._can_carry(topic, seen.type_name, seen.nodes, seen.type_hash):
                continue
            if not self._node.offer(topic.removeprefix("/"), seen.type_name, seen.qos):
                continue
            self._offered[topic] = seen.type_name
            if topic in wanted or seen.qos.transient_local:
                self._dds.listen(topic, seen.type_name, seen.qos, self._carrier_to_zenoh(topic, seen.type_name))
            else:
                self._dds.leave(topic)

    def _carrier_to_zenoh(self, topic: str, type_name: str) -> "_ToZenoh":
        return _ToZenoh(self._node, topic, type_name, self.to_zenoh)

    def _carry_to_dds(self, stop: threading.Event) -> None:
        while not stop.is_set():
            message = self.inbox.receive(_SPIN_S)
            if message is None:
                continue
            try:
                carried = self._dds.publish(message.topic, message.payload)
            except Exception as error:  # whatever the middleware raises for bytes that it cannot send
                _LOG.debug("%s: %s", message.topic, error)
                carried = False
            (self.to_dds.carried if carried else self.to_dds.refused)[message.topic] += 1

    def _is_bridged(self, topic: str) -> bool:
        return topic not in _OF_EVERY_NODE and (not self._below or f"{topic}/".startswith(self._below))

    def _can_carry(self, topic: str, type_name: str, nodes: Sequence[str], hashed: str) -> bool:
        """Whether a topic of these publishers can be carried; why not, and what is odd, is told once."""
        try:
            strange = strange_type(topic, nodes[0], type_name, hashed)
        except WireError as error:
            return self._tell(f"topics of {type_name} are not carried: {error}")
        if strange:
            return self._tell(f"not carried: {strange}")
        if not can_carry(type_name):
            package = type_name.partition("/")[0]
            wheel = "cyclonedds" if type_name == TRANSFORMS else f"ros-{package.replace('_', '-')}"
            how = f"source ROS's setup.bash, or pip install {wheel} where PyPI has it"
            return self._tell(f"topics of {type_name} are not carried: {package} is not installed: {how}")
        if len(nodes) > 1 and type_name in _OF_ONE_CAMERA:
            self._tell(several(topic, nodes))
        return True

    def _tell(self, what: str) -> bool:
        if what not in self._told:
            self._told.add(what)
            _LOG.warning("%s", what)
        return False


@dataclass(frozen=True)
class _ToZenoh:
    node: Ros2Node
    topic: str
    type_name: str
    traffic: Traffic

    def __call__(self, payload: bytes) -> None:
        self.node.tell(Message(self.topic.removeprefix("/"), self.type_name, Stamp(0), payload))
        self.traffic.carried[self.topic] += 1


def _others(endpoints: list[Endpoint]) -> list[Endpoint]:
    """Return the endpoints that are no bridge's: two bridges would carry each other's messages round and round."""
    return [endpoint for endpoint in endpoints if endpoint.node.name != NODE]
