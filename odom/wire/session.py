"""A Zenoh session with what the platform needs to be safe: no shared memory, loopback only, counted messages.

Every message carries an attachment of 33 bytes: flags, the sender's epoch (its start, random), its serial number over
all keys, the sequence number on the key, and the wall time of sending. A foreign message without one is taken as it is.
"""

import json
import logging
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from struct import Struct
from types import TracebackType
from typing import Any, Self

import zenoh

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import cdr
from odom.wire.message import Message
from odom.wire.security import secured, security_configuration
from odom.wire.settings import WireSettings

log = logging.getLogger(__name__)

_ATTACHMENT = Struct("<BQQQq")
_LOSSLESS = 1
_ENCODING = "application/cdr"
_RESERVE = 256
_BUDGET = 128 << 20
_MAX_EPOCHS = 64

_TYPES: tuple[tuple[str, str], ...] = (
    ("/compressed", cdr.COMPRESSED_IMAGE),
    ("/compressedDepth", cdr.COMPRESSED_IMAGE),
    ("/image_raw", cdr.IMAGE),
    ("/camera_info", cdr.CAMERA_INFO),
    ("/pose", cdr.POSE),
    ("/odom", cdr.ODOMETRY),
    ("/path", cdr.PATH),
    ("/status", cdr.DIAGNOSTICS),
    ("/loops", cdr.DIAGNOSTICS),
    ("/end", cdr.STRING),
    ("tf", cdr.TRANSFORMS),
)


@dataclass(frozen=True)
class Delivery:
    """A message as it arrived. `epoch`, `serial`, `sequence` (from 0) and `sent` are None from a foreign sender."""

    message: Message
    lossless: bool = False
    epoch: int | None = None
    serial: int | None = None
    sequence: int | None = None
    sent: Stamp | None = None


@dataclass
class Counters:
    """What happened to the messages of one key: `lost` on the way, `dropped` here because newer ones came."""

    received: int = 0
    lost: int = 0
    dropped: int = 0
    malformed: int = 0
    bytes: int = 0


class Publisher:
    """Publishes messages on any key with serial and sequence numbers; safe to use from several threads.

    `lossless` waits for a congested link, else a message that finds no room within the settings' patience is dropped.
    `urgent` overtakes images; order holds among messages of the same urgency only.
    """

    def __init__(self, session: zenoh.Session, lossless: bool, urgent: bool) -> None:
        self.epoch = secrets.randbits(64)
        self.serial = 0
        self._session = session
        self._lossless = lossless
        self._control = zenoh.CongestionControl.BLOCK if lossless else zenoh.CongestionControl.DROP
        self._priority = zenoh.Priority.DATA_HIGH if urgent else zenoh.Priority.DATA
        self._publishers: dict[tuple[str, str], zenoh.Publisher] = {}
        self._sequences: dict[str, int] = {}
        self._lock = threading.Lock()

    def put(self, message: Message) -> int:
        """Send the message and return its serial number, from 0; raises WireError when the session is closed."""
        with self._lock:
            publisher = self._publishers.get((message.topic, message.type_name)) or self._declare(message)
            sequence = self._sequences.get(message.topic, 0)
            serial = self.serial
            attachment = _ATTACHMENT.pack(
                _LOSSLESS if self._lossless else 0, self.epoch, serial, sequence, time.time_ns()
            )
            try:
                publisher.put(message.payload, attachment=attachment)
            except zenoh.ZError as error:
                raise WireError(f"{message.topic} cannot be published: {error}") from error
            self._sequences[message.topic] = sequence + 1
            self.serial = serial + 1
        return serial

    def close(self) -> None:
        """Undeclare all keys."""
        with self._lock:
            for publisher in self._publishers.values():
                publisher.undeclare()  # type: ignore[no-untyped-call]  # zenoh gives no type
            self._publishers.clear()

    def _declare(self, message: Message) -> zenoh.Publisher:
        try:
            publisher = self._session.declare_publisher(
                message.topic,
                encoding=f"{_ENCODING};{message.type_name}",
                congestion_control=self._control,
                priority=self._priority,
            )
        except zenoh.ZError as error:
            raise WireError(f"{message.topic} cannot be published: {error}") from error
        self._publishers[message.topic, message.type_name] = publisher
        return publisher


class Subscriber:
    """Messages of several keys in the order in which they arrived, in one bounded queue.

    Of a live key at most `depth` messages wait, the newest win; messages of a lossless sender all wait (its flow
    control bounds them; beyond 256 the oldest go) when `lossless`, else they are treated as live ones. Beyond 128 MiB
    the oldest of all go.
    """

    def __init__(self, session: zenoh.Session, keys: Iterable[str], depth: int, lossless: bool) -> None:
        self.counters: dict[str, Counters] = {}
        self._depth = depth
        self._lossless = lossless
        self._queue: deque[tuple[str, Delivery | None, zenoh.Sample]] = deque()
        self._waiting: dict[str, int] = {}
        self._bytes = 0
        self._expected: dict[tuple[str, int], int] = {}
        self._ready = threading.Condition()
        self._closed = False
        self._complained: set[str] = set()
        handler = zenoh.handlers.Callback(self._arrive, indirect=False)
        try:
            self._subscribers = [session.declare_subscriber(key, handler) for key in keys]
        except zenoh.ZError as error:
            raise WireError(f"cannot subscribe to {', '.join(keys)}: {error}") from error

    def receive(self, timeout: float | None = None) -> Delivery | None:
        """Return the next message, None when none came within `timeout` seconds (None: wait) or after `close`.

        A malformed message is counted, logged once for its key, and passed over.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            with self._ready:
                while not self._queue and not self._closed:
                    left = None if deadline is None else deadline - time.monotonic()
                    if left is not None and left <= 0:
                        return None
                    self._ready.wait(left)
                if not self._queue:
                    return None
                topic, header, sample = self._take(0)
            try:
                delivery = _delivery(topic, header, sample)
            except WireError as error:
                self.malformed(topic, str(error))
                continue
            self.counters[topic].bytes += len(delivery.message.payload)
            return delivery

    @property
    def waiting(self) -> int:
        """Messages in the queue."""
        return len(self._queue)

    def malformed(self, topic: str, why: str) -> None:
        """Count a message that could not be used, and log the first of its key."""
        self.counters.setdefault(topic, Counters()).malformed += 1
        if topic not in self._complained:
            self._complained.add(topic)
            log.warning("%s: dropped a malformed message (further ones are counted): %s", topic, why)

    def total(self) -> Counters:
        """Return the sums over all keys."""
        total = Counters()
        for counters in list(self.counters.values()):
            for name in vars(total):
                setattr(total, name, getattr(total, name) + getattr(counters, name))
        return total

    def close(self) -> None:
        """Stop; whoever waits in `receive` gets what is queued, then None."""
        with self._ready:
            self._closed = True
            self._ready.notify_all()
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh gives no type
        self._subscribers = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _arrive(self, sample: zenoh.Sample) -> None:
        topic = str(sample.key_expr)
        header = _header(sample)
        keep_all = self._lossless and header is not None and header.lossless
        with self._ready:
            if self._closed:
                return
            if topic not in self.counters and len(self.counters) >= _RESERVE:
                return  # a flood of invented keys must not fill the memory
            counters = self.counters.setdefault(topic, Counters())
            counters.received += 1
            if header is not None and header.epoch is not None and header.sequence is not None:
                counters.lost += self._gap(topic, header.epoch, header.sequence)
            if self._waiting.get(topic, 0) >= (_RESERVE if keep_all else self._depth):
                self._drop(next(i for i, entry in enumerate(self._queue) if entry[0] == topic))
            while self._queue and self._bytes + len(sample.payload) > _BUDGET:
                self._drop(0)
            self._queue.append((topic, header, sample))
            self._waiting[topic] = self._waiting.get(topic, 0) + 1
            self._bytes += len(sample.payload)
            self._ready.notify()

    def _take(self, index: int) -> tuple[str, Delivery | None, zenoh.Sample]:
        entry = self._queue[index]
        del self._queue[index]
        self._waiting[entry[0]] -= 1
        self._bytes -= len(entry[2].payload)
        return entry

    def _drop(self, index: int) -> None:
        topic, _, _ = self._take(index)
        self.counters[topic].dropped += 1

    def _gap(self, topic: str, epoch: int, sequence: int) -> int:
        expected = self._expected.get((topic, epoch))
        if expected is None and len(self._expected) >= _MAX_EPOCHS * max(1, len(self.counters)):
            self._expected.clear()
        self._expected[topic, epoch] = max(sequence + 1, expected or 0)
        return max(0, sequence - expected) if expected is not None else 0


@dataclass
class WireSession:
    """An open Zenoh session; `close` undeclares everything that was declared through it."""

    zenoh: zenoh.Session
    settings: WireSettings
    _stack: ExitStack = field(default_factory=ExitStack)

    def publisher(self, lossless: bool = False, urgent: bool = False) -> Publisher:
        """Return a publisher for any key; see `Publisher`."""
        publisher = Publisher(self.zenoh, lossless, urgent)
        self._stack.callback(publisher.close)
        return publisher

    def subscriber(self, keys: Iterable[str], depth: int = 3, lossless: bool = False) -> Subscriber:
        """Return a subscriber of the key expressions; see `Subscriber`."""
        subscriber = Subscriber(self.zenoh, tuple(keys), depth, lossless)
        self._stack.callback(subscriber.close)
        return subscriber

    def announce(self, key: str) -> None:
        """Declare this process alive under `key` until the session closes or the process dies."""
        token = self.zenoh.liveliness().declare_token(key)
        self._stack.callback(token.undeclare)

    def watch(self, key_expr: str, changed: Callable[[str, bool], None]) -> None:
        """Call `changed(key, alive)` now for each living token and whenever one comes or goes.

        The calls come from another thread.
        """

        def arrive(sample: zenoh.Sample) -> None:
            changed(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        watcher = self.zenoh.liveliness().declare_subscriber(key_expr, arrive, history=True)
        self._stack.callback(watcher.undeclare)

    def close(self) -> None:
        """Undeclare everything and close the session; safe to call twice."""
        self._stack.close()
        if not self.zenoh.is_closed():
            self.zenoh.close()  # type: ignore[no-untyped-call]  # zenoh gives no type


@contextmanager
def open_session(settings: WireSettings, further: Mapping[str, Any] | None = None) -> Iterator[WireSession]:
    """Open a session and close it at the end; `further` overrides `settings.zenoh` (security puts its part there).

    Raises WireError when the configuration is not accepted or no endpoint can be used.
    """
    config = zenoh.Config()
    try:
        for path, value in {**_configuration(settings), **settings.zenoh, **(further or {})}.items():
            config.insert_json5(path, json.dumps(value))
        opened = zenoh.open(config)
    except zenoh.ZError as error:
        where = ", ".join((*settings.listen, *settings.connect))
        raise WireError(f"cannot open a Zenoh session as {settings.mode} at {where}: {error}") from error
    session = WireSession(opened, settings)
    try:
        yield session
    finally:
        session.close()


def _configuration(settings: WireSettings) -> dict[str, Any]:
    patience = settings.drop_after_ms * 1000
    return {
        "mode": settings.mode,
        "connect/endpoints": secured(settings.connect, settings.security),
        "connect/exit_on_failure": settings.mode == "client",
        "connect/timeout_ms": 5000 if settings.mode == "client" else -1,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2},
        "listen/endpoints": [] if settings.mode == "client" else secured(settings.listen, settings.security),
        "listen/exit_on_failure": False,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": settings.lease_ms,
        "transport/link/tx/queue/size/data": 8,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": patience,
        "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments": 2 * patience,
        **security_configuration(settings.security),
    }


def _header(sample: zenoh.Sample) -> Delivery | None:
    """Return the attachment as a delivery still without its message, None when there is none of ours."""
    if sample.attachment is None or len(sample.attachment) != _ATTACHMENT.size:
        return None
    flags, epoch, serial, sequence, sent = _ATTACHMENT.unpack(sample.attachment.to_bytes())
    return Delivery(_NO_MESSAGE, bool(flags & _LOSSLESS), epoch, serial, sequence, Stamp(sent))


_NO_MESSAGE = Message("", "", Stamp(0), b"")


def _delivery(topic: str, header: Delivery | None, sample: zenoh.Sample) -> Delivery:
    payload = sample.payload.to_bytes()
    encoding, _, name = str(sample.encoding).partition(";")
    type_name = name if encoding == _ENCODING and name else _type_of(topic)
    stamp = cdr.stamp_of(type_name, payload)
    if stamp is None:
        stamp = header.sent if header is not None and header.sent is not None else Stamp(time.time_ns())
    message = Message(topic, type_name, stamp, payload)
    if header is None:
        return Delivery(message)
    return Delivery(message, header.lossless, header.epoch, header.serial, header.sequence, header.sent)


def _type_of(topic: str) -> str:
    for suffix, type_name in _TYPES:
        if topic.endswith(suffix):
            return type_name
    raise WireError(f"{topic}: neither its encoding nor its name tells the message type")
