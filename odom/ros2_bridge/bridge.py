"""Which topics go where: each is offered on the other side, and carried while somebody there listens."""

import logging
import threading
import time
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field

from odom.errors import WireError
from odom.frame import Stamp
from odom.ros2_bridge.dds import NODE, DdsNode, DdsTopic, can_publish, message_class
from odom.wire.message import Message
from odom.wire.ros2.graph import RosGraph
from odom.wire.ros2.inbox import Inbox
from odom.wire.ros2.names import SUBSCRIBER, Endpoint, NodeName
from odom.wire.ros2.node import Ros2Node
from odom.wire.session import WireSession

_LOG = logging.getLogger(__name__)
_LOOK_S = 0.25
"""Seconds between two looks at both graphs. Shorter: more time for nothing; longer: who comes gets messages later."""
_SPIN_S = 0.05
"""Longest wait for a message of DDS before anything else is looked at. Chosen by hand."""
_DEPTH = 10
"""Messages of a topic that may wait for DDS; the newest win. Larger: a stall costs more memory (9 MB at 10 images);
smaller: a short stall loses messages."""
_OF_EVERY_NODE = ("/rosout", "/parameter_events")
"""Topics of ROS itself, which every node of both sides has."""


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
        self._dds = dds
        self._below = tuple("/" + name.strip("/") + "/" for name in below)
        self._node = Ros2Node(session.zenoh, NodeName(domain, str(session.zenoh.info.zid()), 0, "/", NODE))
        session.at_close(self._node.close)
        self._published = RosGraph(session, domain)
        self._wanted = RosGraph(session, domain, SUBSCRIBER)
        self.inbox = Inbox(self._node, _DEPTH)
        session.at_close(self.inbox.close)
        self._offered: dict[str, str] = {}
        self._unknown: set[str] = set()
        self._to_dds: set[str] = set()

    def run(self, stop: threading.Event) -> None:
        """Carry messages until `stop` is set."""
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

    @property
    def lost(self) -> Counter[str]:
        """Messages that did not get across, by topic and for any reason."""
        return self._dds.lost + self.to_dds.refused + self.to_zenoh.refused

    def _look(self) -> None:
        on_zenoh = {topic: _others(ends) for topic, ends in self._published.endpoints().items()}
        wanted_on_zenoh = {topic for topic, ends in self._wanted.endpoints().items() if _others(ends)}
        on_dds, wanted_on_dds = self._dds.published(), self._dds.wanted()
        self._offer_to_dds({t: ends[0] for t, ends in on_zenoh.items() if ends and self._is_bridged(t)}, wanted_on_dds)
        self._offer_to_zenoh({t: seen for t, seen in on_dds.items() if self._is_bridged(t)}, wanted_on_zenoh)

    def _offer_to_dds(self, topics: dict[str, Endpoint], wanted: Collection[str]) -> None:
        for gone in self._to_dds - topics.keys():
            self.inbox.unsubscribe(gone)
            self._dds.withdraw(gone)
        self._to_dds &= topics.keys()
        for topic, endpoint in topics.items():
            if not can_publish(endpoint.type_name) and not self._is_known(endpoint.type_name):
                continue
            self._dds.offer(topic, endpoint.type_name, endpoint.qos)
            self._to_dds.add(topic)
            if topic in wanted or endpoint.qos.transient_local:
                try:
                    self.inbox.subscribe(endpoint)
                except WireError as error:
                    self._tell_unknown(endpoint.type_name, str(error))
            else:
                self.inbox.unsubscribe(topic)

    def _offer_to_zenoh(self, topics: dict[str, DdsTopic], wanted: Collection[str]) -> None:
        for gone in self._offered.keys() - topics.keys():
            self._dds.leave(gone)
            self._node.withdraw(gone.removeprefix("/"), self._offered.pop(gone))
        for topic, seen in topics.items():
            if not self._is_known(seen.type_name):
                continue
            if not self._node.offer(topic.removeprefix("/"), seen.type_name, seen.qos):
                self._tell_unknown(seen.type_name, "")
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

    def _is_known(self, type_name: str) -> bool:
        if message_class(type_name) is not None:
            return type_name not in self._unknown
        package = type_name.partition("/")[0]
        wheel = f"ros-{package.replace('_', '-')}"
        how = f"source ROS's setup.bash, or pip install {wheel} where PyPI has it"
        into = " to Zenoh" if can_publish(type_name) else ""
        self._tell_unknown(type_name, f"{package} is not installed: {how}", into)
        return False

    def _tell_unknown(self, type_name: str, why: str, into: str = "") -> None:
        if type_name not in self._unknown:
            self._unknown.add(type_name)
            _LOG.warning("topics of %s are not carried%s%s", type_name, into, f": {why}" if why else "")


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
