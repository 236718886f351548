"""The sending side of a session: messages on any key, numbered."""

import secrets
import threading
import time
from typing import Protocol

import zenoh

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.delivery import Attachment, encoding_of
from odom.wire.message import Message


class Mirror(Protocol):
    """Publishes every message a second time, for others (see `odom.wire.ros2`)."""

    def put(self, message: Message, payload: zenoh.ZBytes, urgent: bool = False) -> None:
        """Publish the bytes of a message, which are not copied again; raises nothing."""


class Publisher:
    """Publishes messages on any key with serial and sequence numbers; safe to use from several threads.

    `lossless`: wait for a congested link; otherwise a message that finds no room within `drop_after_ms` of the settings
    is dropped. `urgent`: overtake images; only messages of the same urgency stay in order. `mirror` is given the same
    messages.
    """

    def __init__(self, session: zenoh.Session, lossless: bool, urgent: bool, mirror: Mirror | None = None) -> None:
        self.epoch = secrets.randbits(64)
        self.serial = 0
        self._session = session
        self._mirror, self._urgent = mirror, urgent
        self._lossless = lossless
        self._control = zenoh.CongestionControl.BLOCK if lossless else zenoh.CongestionControl.DROP
        self._priority = zenoh.Priority.DATA_HIGH if urgent else zenoh.Priority.DATA
        self._publishers: dict[tuple[str, str], zenoh.Publisher] = {}
        self._sequences: dict[str, int] = {}
        self._lock = threading.Lock()

    def put(self, message: Message) -> int:
        """Send the message and return its serial number, from 0; raises WireError when the session is closed."""
        with self._lock:
            sequence, serial = self._sequences.get(message.topic, 0), self.serial
            attachment = Attachment(self._lossless, self.epoch, serial, sequence, Stamp(time.time_ns()))
            payload = zenoh.ZBytes(message.payload)
            try:
                publisher = self._publishers.get((message.topic, message.type_name)) or self._declare(
                    message.topic, message.type_name
                )
                publisher.put(payload, attachment=attachment.pack())
            except zenoh.ZError as error:
                raise WireError(f"{message.topic} cannot be published: {error}") from error
            self._sequences[message.topic] = sequence + 1
            self.serial = serial + 1
            if self._mirror is not None:
                self._mirror.put(message, payload, self._urgent)
        return serial

    def is_heard(self, topic: str, type_name: str) -> bool:
        """Whether anyone takes what is published on the topic; always with a `mirror`, whose listeners are not known.

        Raises WireError when the session is closed.
        """
        if self._mirror is not None:
            return True
        with self._lock:
            try:
                publisher = self._publishers.get((topic, type_name)) or self._declare(topic, type_name)
                return is_matched(publisher)
            except zenoh.ZError as error:
                raise WireError(f"{topic} cannot be published: {error}") from error

    def close(self) -> None:
        """Undeclare all keys."""
        with self._lock:
            for publisher in self._publishers.values():
                publisher.undeclare()  # type: ignore[no-untyped-call]  # zenoh gives no type
            self._publishers.clear()

    def _declare(self, topic: str, type_name: str) -> zenoh.Publisher:
        encoding = encoding_of(type_name)
        publisher = self._session.declare_publisher(
            topic, encoding=encoding, congestion_control=self._control, priority=self._priority
        )
        self._publishers[topic, type_name] = publisher
        return publisher


def is_matched(declared: zenoh.Publisher | zenoh.Querier) -> bool:
    """Whether anybody is known who takes what it publishes or answers what it asks; raises ZError when it is closed."""
    return bool(declared.matching_status.matching)  # type: ignore[attr-defined]  # zenoh's stub says bool
