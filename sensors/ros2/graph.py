"""Who publishes what in a ROS 2 domain, as the nodes' liveliness tokens tell."""

import threading

from odom.wire.codec.cdr import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE
from odom.wire.ros2.names import PUBLISHER, Endpoint, endpoint_of, endpoints_of
from odom.wire.session import WireSession

_MOST_ENDPOINTS = 10_000
"""Publishers that are remembered, some kilobytes each: a bound against a flood of invented tokens."""
_DEPTH_WORDS = ("depth", "disparity")
_COMPRESSED, _COMPRESSED_DEPTH = "/compressed", "/compressedDepth"


class RosGraph:
    """The publishers of a domain that live now."""

    def __init__(self, session: WireSession, domain: int) -> None:
        self._lock = threading.Lock()
        self._endpoints: dict[str, Endpoint] = {}
        session.watch(endpoints_of(domain, PUBLISHER), self._change)

    def publishers(self, prefix: str = "/") -> dict[str, list[Endpoint]]:
        """Return the publishers of the topics below a name, by topic, in the order of their names."""
        below = prefix.rstrip("/") + "/"
        with self._lock:
            endpoints = [e for e in self._endpoints.values() if e.topic.startswith(below)]
        found: dict[str, list[Endpoint]] = {}
        for endpoint in sorted(endpoints, key=lambda e: (e.topic, e.node.full_name)):
            found.setdefault(endpoint.topic, []).append(endpoint)
        return found

    def _change(self, token: str, alive: bool) -> None:
        endpoint = endpoint_of(token)
        with self._lock:
            if not alive:
                self._endpoints.pop(token, None)
            elif endpoint is not None and len(self._endpoints) < _MOST_ENDPOINTS:
                self._endpoints[token] = endpoint


def image_topics(topics: dict[str, list[Endpoint]], compressed: bool) -> list[str]:
    """Return the topics of images, of each image one: as it is, or with `compressed` as a file, if there are both.

    A driver offers each image in several forms and makes those that somebody subscribes to.
    """
    forms: dict[str, list[str]] = {}
    for topic, endpoints in topics.items():
        if endpoints[0].type_name == IMAGE:
            forms.setdefault(topic, []).append(topic)
        elif endpoints[0].type_name == COMPRESSED_IMAGE and topic.endswith((_COMPRESSED, _COMPRESSED_DEPTH)):
            forms.setdefault(topic.rpartition("/")[0], []).append(topic)
    return sorted(min(offered, key=lambda topic: _order(base, topic, compressed)) for base, offered in forms.items())


def info_topics(topics: dict[str, list[Endpoint]]) -> list[str]:
    """Return the topics of calibrations."""
    return [topic for topic, endpoints in topics.items() if endpoints[0].type_name == CAMERA_INFO]


def _order(base: str, topic: str, compressed: bool) -> tuple[bool, bool]:
    is_depth = any(word in base.lower() for word in _DEPTH_WORDS)
    fitting = base + (_COMPRESSED_DEPTH if is_depth else _COMPRESSED)
    return ((topic != base) != compressed, topic not in (base, fitting))
