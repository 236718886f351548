"""A Zenoh session with safe settings: no shared memory, no multicast scouting, bounded queues, counted messages."""

import json
import logging
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

import zenoh

from odom.errors import ConfigError, WireError
from odom.wire.delivery import Delivery
from odom.wire.publisher import Mirror, Publisher
from odom.wire.security import SecuritySettings, secured, security_configuration
from odom.wire.settings import WireSettings
from odom.wire.subscriber import ReceptionCounters, Subscriber

_LOG = logging.getLogger(__name__)

_ADVICE = {
    "listener": "; end what listens there, or give another --listen",
    "Unable to connect": "; is `odom router --listen` up at that address and port, and does a firewall let it through?"
    " With --tls or a password, the router's log says why it refuses a client.",
}
"""What to do about Zenoh's reasons, by words that they hold."""
_SETTINGS = {"connect/endpoints": "wire.connect (--connect)", "listen/endpoints": "wire.listen (--listen)"}
"""The settings of endpoints, by Zenoh's own names for them."""
_SOURCE_LINE = re.compile(r" at \S+\.rs:\d+")
_QUOTED = re.compile(r'"(.*)"')
"""The words for people in what Zenoh raises for a setting."""
_IP_ENDPOINT = re.compile(r"(tcp|tls|udp|quic|ws)/(\[[^\]]+\]|[^:/\[\]]+):(\d+)([?#].*)?\Z")
"""HOST:PORT, and behind it what Zenoh may be told about the link."""
_OTHER_ENDPOINT = re.compile(r"(?!(tcp|tls|udp|quic|ws)/)[a-z0-9_-]+/.+\Z")
"""One of a protocol without ports, a Unix socket for instance, or of one that Zenoh refuses."""
_LAST_PORT = 65535
"""The largest number of a port: 16 bits of TCP's and UDP's headers. Larger: Zenoh tries for ever what is none."""
_CLIENT_TIMEOUT_MS = 5000
"""How long a client looks for its router before it fails, in ms. Longer: a wrong address is reported later; shorter: a
router that starts at the same time is missed. Peers look for ever."""
_LIVING_S = 1.0
"""Seconds to wait for those who say that they live. Shorter: a far one is missed; longer: the asker does nothing."""
_RETRY = {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2}
"""Pause between two attempts to connect: doubled from 0.1 s to 1 s. Longer: processes meet later after a restart."""
_QUEUE_BATCHES = 8
"""Batches of 64 kB that wait for a link. More: older images on a slow link; fewer: an image needs more turns."""

__all__ = ["Delivery", "Publisher", "ReceptionCounters", "Subscriber", "WireSession", "open_session"]


@dataclass
class WireSession:
    """An open Zenoh session; `close` undeclares everything that was declared through it."""

    zenoh: zenoh.Session
    _stack: ExitStack = field(default_factory=ExitStack)

    def publisher(self, lossless: bool = False, urgent: bool = False, mirror: Mirror | None = None) -> Publisher:
        """Return a publisher for any key; see `Publisher`."""
        publisher = Publisher(self.zenoh, lossless, urgent, mirror)
        self._stack.callback(publisher.close)
        return publisher

    def subscriber(
        self, keys: Iterable[str], depth: int = 3, small_depth: int = 0, lossless: bool = False
    ) -> Subscriber:
        """Return a subscriber of the key expressions; see `Subscriber`."""
        subscriber = Subscriber(self.zenoh, tuple(keys), depth, small_depth, lossless)
        self._stack.callback(subscriber.close)
        return subscriber

    def at_close(self, action: Callable[[], None]) -> None:
        """Call `action` when the session closes."""
        self._stack.callback(action)

    def enter(self, other: AbstractContextManager["WireSession"]) -> "WireSession":
        """Open another session, which closes with this one."""
        return self._stack.enter_context(other)

    def announce(self, key: str) -> None:
        """Declare this process alive under `key` until the session closes or the process dies."""
        token = self.zenoh.liveliness().declare_token(key)
        self._stack.callback(token.undeclare)

    def watch(self, key_expr: str, changed: Callable[[str, bool], None]) -> None:
        """Call `changed(key, alive)`, from another thread, for each living token and whenever one comes or goes."""

        def arrive(sample: zenoh.Sample) -> None:
            changed(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        watcher = self.zenoh.liveliness().declare_subscriber(key_expr, arrive, history=True)
        self._stack.callback(watcher.undeclare)

    def living(self, key_expr: str) -> list[str]:
        """Return the keys of the living tokens, of those who answer within a second."""
        replies = self.zenoh.liveliness().get(key_expr, timeout=_LIVING_S)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    @property
    def is_connected(self) -> bool:
        """Whether any other session is connected to this one."""
        return bool(self.zenoh.info.peers_zid() or self.zenoh.info.routers_zid())

    def close(self) -> None:
        """Undeclare everything and close the session; safe to call twice."""
        self._stack.close()
        if not self.zenoh.is_closed():
            self.zenoh.close()  # type: ignore[no-untyped-call]  # zenoh gives no type


@contextmanager
def open_session(settings: WireSettings) -> Iterator[WireSession]:
    """Open a session and close it at the end.

    Raises ConfigError for what is no endpoint or no setting of Zenoh, WireError when no endpoint can be used.
    """
    config = zenoh_config(settings)
    _warn_of_expiry(settings.security)
    try:
        opened = zenoh.open(config)
    except zenoh.ZError as error:
        where = ", ".join((*(settings.listen if settings.mode != "client" else ()), *settings.connect))
        reason = _SOURCE_LINE.sub("", str(error))
        advice = "".join(words for sign, words in _ADVICE.items() if sign in reason)
        raise WireError(f"cannot open a Zenoh session as {settings.mode} at {where}: {reason}{advice}") from error
    session = WireSession(opened)
    try:
        yield session
    finally:
        session.close()


def zenoh_config(settings: WireSettings) -> zenoh.Config:
    """Return what Zenoh is told.

    Raises ConfigError for what it would not take or would try for ever, and for certificates that are not valid now.
    """
    _check_endpoints((*settings.connect, *settings.listen))
    config = zenoh.Config()
    for path, value in {**_configuration(settings), **settings.zenoh}.items():
        try:
            config.insert_json5(path, json.dumps(value))
        except zenoh.ZError as error:
            reason = _SOURCE_LINE.sub("", str(error))
            quoted = _QUOTED.search(reason)
            name = f"wire.zenoh: {path!r}" if path in settings.zenoh else _SETTINGS.get(path, path)
            raise ConfigError(f"{name} cannot be set: {quoted[1] if quoted else reason}") from error
    if settings.security.tls:
        from odom.wire.expiry import check_validity

        check_validity(settings.security.certificates)
    return config


def _warn_of_expiry(security: SecuritySettings) -> None:
    if security.tls:
        from odom.wire.expiry import due

        for words in due(security.certificates):
            _LOG.warning("%s", words)


def _check_endpoints(endpoints: tuple[str, ...]) -> None:
    """Refuse what Zenoh would try for ever, in silence: an address without a port."""
    for where in endpoints:
        found = _IP_ENDPOINT.match(where)
        if not (int(found[3]) <= _LAST_PORT if found else _OTHER_ENDPOINT.match(where)):
            raise ConfigError(f"{where[:60]!r} is no endpoint: give PROTOCOL/HOST:PORT, as in tcp/rig:7447")


def _listeners(settings: WireSettings) -> list[str]:
    """Return the endpoints to listen on; those that nobody asked for may be in use by another process already.

    A router must have them all, since the others look for it there. All others listen at one more port of the host of
    each meeting point: where that is in use, they could not be reached otherwise.
    """
    is_router = settings.mode == "router"
    asked = [where for where in settings.listen if is_router or not settings.left_to_ros2(where)]
    beside = [_IP_ENDPOINT.sub(r"\1/\2:0\4", where) for where in asked if where in settings.connect and not is_router]
    listen = list(dict.fromkeys([*asked, *beside]))
    demanded = [is_router or (where in asked and settings.on_purpose(where)) for where in listen]
    return [
        where if is_demanded else f"{where}{';' if '#' in where else '#'}exit_on_failure=false"
        for where, is_demanded in zip(secured(listen, settings.security), demanded, strict=True)
    ]


def _configuration(settings: WireSettings) -> dict[str, Any]:
    """Return the Zenoh configuration, path to value.

    Shared memory is off: with it, a stalled receiver was given a frame with another frame's bytes (1 in 330).
    """
    patience = settings.drop_after_ms * 1000
    return {
        "mode": settings.mode,
        "connect/endpoints": secured(settings.connect, settings.security),
        "connect/exit_on_failure": settings.mode == "client",
        "connect/timeout_ms": _CLIENT_TIMEOUT_MS if settings.mode == "client" else -1,
        "connect/retry": _RETRY,
        "listen/endpoints": [] if settings.mode == "client" else _listeners(settings),
        "listen/exit_on_failure": True,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        **({"scouting/delay": 0} if settings.mode == "router" and not settings.connect else {}),  # nobody to wait for
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": settings.lease_ms,
        "transport/link/tx/queue/size/data": _QUEUE_BATCHES,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": patience,
        "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments": 2 * patience,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": settings.lease_ms * 1000,
        **security_configuration(settings.security),
    }
