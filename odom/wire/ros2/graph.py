"""Who publishes and who listens in a ROS 2 domain, by the nodes' liveliness tokens."""

import threading
from collections.abc import Sequence

from odom.wire.ros2.names import NO_TYPE_HASH, PUBLISHER, Endpoint, Kind, endpoint_of, endpoints_of, type_hash
from odom.wire.session import WireSession

_MOST_ENDPOINTS = 10_000
"""Endpoints that are remembered, some kilobytes each: a bound against a flood of invented tokens."""


class RosGraph:
    """The publishers, or the subscribers, of a domain that live now."""

    def __init__(self, session: WireSession, domain: int, kind: Kind = PUBLISHER) -> None:
        self._lock = threading.Lock()
        self._endpoints: dict[str, Endpoint] = {}
        session.watch(endpoints_of(domain, kind), self._change)

    def endpoints(self, prefix: str = "/") -> dict[str, list[Endpoint]]:
        """Return those of the topics below a name, by topic, in the order of their nodes' names."""
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


def strange_type(topic: str, node: str, type_name: str, hashed: str) -> str:
    """Return a warning about a publisher whose type differs from ROS 2's type of the same name, else nothing.

    `hashed` is the hash of its definition, empty where it gives none. Raises WireError for a type that ROS 2 does not
    define.
    """
    if hashed in ("", NO_TYPE_HASH, type_hash(type_name)):
        return ""
    return (
        f"{topic} of {node} is of another {type_name} than ROS 2's (its definition has the hash {hashed:.20}...): it "
        "cannot be read; build that node with the official messages"
    )


def several(topic: str, nodes: Sequence[str]) -> str:
    """Return a warning where several nodes publish one topic."""
    return (
        f"{len(nodes)} nodes publish {topic}: {', '.join(nodes)}; their messages alternate. End all but one, or give "
        "each a namespace of its own"
    )
