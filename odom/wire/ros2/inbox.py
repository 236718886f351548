"""Messages of ROS 2 topics as they arrive, in one bounded queue; what is lost and dropped is counted."""

import logging
import threading
from collections import Counter, deque
from dataclasses import dataclass
from typing import Any

import zenoh
import zenoh.ext

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import stamp_of
from odom.wire.codec.cdr import TRANSFORMS
from odom.wire.message import Message
from odom.wire.ros2.attachment import ros_attachment_of
from odom.wire.ros2.names import SUBSCRIBER, Endpoint
from odom.wire.ros2.node import Ros2Node
from odom.wire.ros2.qos import TRANSFORMS_DEPTH, Qos

_LOG = logging.getLogger(__name__)
_MOST_WAITING_BYTES = 256 << 20
"""Bytes of all messages that wait. Fewer: a camera of large images loses some while others are searched for; more: a
flood takes more memory."""
_MOST_BYTES = 64 << 20
"""Bytes of a single message beyond which it is no image but a mistake: an image of 4K in four channels takes 33 MB."""


@dataclass
class _Topic:
    type_name: str
    subscriber: Any
    token: Any
    gid: bytes = b""
    sequence: int = 0


class Inbox:
    """Subscribes as a node of ROS 2 does; of each topic at most `depth` messages wait, and the newest win.

    Of transforms, which many nodes publish, more may wait (`TRANSFORMS_DEPTH`). `counts` has `received`, `lost` (gaps
    in the publishers' numbers), `dropped` (not taken in time) and `malformed`.
    """

    def __init__(self, node: Ros2Node, depth: int) -> None:
        self.counts: Counter[str] = Counter()
        self._node, self._depth = node, depth
        self._topics: dict[str, _Topic] = {}
        self._queue: deque[Message] = deque()
        self._ready = threading.Condition()
        self._closed = False

    def subscribe(self, publisher: Endpoint) -> None:
        """Listen to a topic with this publisher's type, including what it keeps for late joiners."""
        if publisher.topic in self._topics:
            return
        depth = self._depth_of(publisher.type_name)
        qos = Qos(depth, transient_local=publisher.qos.transient_local)
        mine = self._node.endpoint(SUBSCRIBER, publisher.topic, publisher.type_name, qos)
        kept = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=depth)
        subscriber = zenoh.ext.declare_advanced_subscriber(
            self._node.session,
            publisher.key(),
            lambda sample: self._take(publisher.topic, publisher.type_name, sample),
            history=kept if publisher.qos.transient_local else None,
            subscriber_detection=publisher.qos.transient_local,
            allowed_origin=zenoh.Locality.REMOTE,
        )
        token = self._node.session.liveliness().declare_token(mine.token())
        self._topics[publisher.topic] = _Topic(publisher.type_name, subscriber, token)

    def unsubscribe(self, topic: str) -> None:
        """Stop listening to a topic; what waits of it is forgotten."""
        with self._ready:
            known = self._topics.pop(topic, None)
            self._queue = deque(message for message in self._queue if message.topic != topic)
        if known is not None:
            known.token.undeclare()
            known.subscriber.undeclare()

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics that are listened to."""
        return tuple(self._topics)

    def limit(self, depth: int) -> None:
        """From now on let `depth` messages of a topic wait."""
        with self._ready:
            self._depth = depth
            for topic, known in self._topics.items():
                self._drop_old(topic, known.type_name)

    def waiting(self) -> tuple[Message, ...]:
        """Return the messages that wait, oldest first; they go on waiting."""
        with self._ready:
            return tuple(self._queue)

    def receive(self, timeout: float) -> Message | None:
        """Return the next message, its `topic` with the slash before; None after `timeout` s or `close`."""
        with self._ready:
            self._ready.wait_for(lambda: self._queue or self._closed, timeout)
            return self._queue.popleft() if self._queue and not self._closed else None

    def close(self) -> None:
        """Stop listening to all."""
        with self._ready:
            self._closed = True
            self._ready.notify_all()
        for topic in self.topics:
            self.unsubscribe(topic)

    def _depth_of(self, type_name: str) -> int:
        return max(self._depth, TRANSFORMS_DEPTH if type_name == TRANSFORMS else 0)

    def _take(self, topic: str, type_name: str, sample: zenoh.Sample) -> None:
        if len(sample.payload) > _MOST_BYTES:
            self.counts["malformed"] += 1
            return
        payload = sample.payload.to_bytes()
        try:
            stamp = stamp_of(type_name, payload)
        except WireError as error:
            self.counts["malformed"] += 1
            _LOG.debug("%s: %s", topic, error)
            return
        message = Message(topic, type_name, Stamp(0) if stamp is None else stamp, payload)
        with self._ready:
            self._count(topic, sample)
            self._queue.append(message)
            self._drop_old(topic, type_name)
            while sum(len(other.payload) for other in self._queue) > _MOST_WAITING_BYTES:
                self._queue.popleft()
                self.counts["dropped"] += 1
            self._ready.notify()

    def _drop_old(self, topic: str, type_name: str) -> None:
        waiting = [message for message in self._queue if message.topic == topic]
        for old in waiting[: -self._depth_of(type_name)]:
            self._queue.remove(old)
            self.counts["dropped"] += 1

    def _count(self, topic: str, sample: zenoh.Sample) -> None:
        self.counts["received"] += 1
        known = self._topics.get(topic)
        attachment = None if sample.attachment is None else ros_attachment_of(sample.attachment.to_bytes())
        if known is None or attachment is None:
            return
        if attachment.gid == known.gid:
            self.counts["lost"] += max(0, attachment.sequence - known.sequence - 1)
        known.gid, known.sequence = attachment.gid, attachment.sequence
