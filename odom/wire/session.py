"""A Zenoh session with what the platform needs to be safe: no shared memory, loopback only, counted messages."""

import json
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

import zenoh

from odom.errors import WireError
from odom.wire.delivery import Delivery
from odom.wire.publisher import Publisher
from odom.wire.security import secured, security_configuration
from odom.wire.settings import WireSettings
from odom.wire.subscriber import Counters, Subscriber

_SOURCE_LINE = re.compile(r" at \S+\.rs:\d+")

__all__ = ["Counters", "Delivery", "Publisher", "Subscriber", "WireSession", "open_session"]


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

    def subscriber(
        self, keys: Iterable[str], depth: int = 3, small_depth: int = 0, lossless: bool = False
    ) -> Subscriber:
        """Return a subscriber of the key expressions; see `Subscriber`."""
        subscriber = Subscriber(self.zenoh, tuple(keys), depth, small_depth, lossless)
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
def open_session(settings: WireSettings) -> Iterator[WireSession]:
    """Open a session and close it at the end.

    Raises WireError when the configuration is not accepted or no endpoint can be used.
    """
    config = zenoh.Config()
    try:
        for path, value in {**_configuration(settings), **settings.zenoh}.items():
            config.insert_json5(path, json.dumps(value))
        opened = zenoh.open(config)
    except zenoh.ZError as error:
        where = ", ".join((*settings.listen, *settings.connect))
        said = _SOURCE_LINE.sub("", str(error))
        advice = "; end what listens there, or give another --listen" if "listener" in said else ""
        raise WireError(f"cannot open a Zenoh session as {settings.mode} at {where}: {said}{advice}") from error
    session = WireSession(opened, settings)
    try:
        yield session
    finally:
        session.close()


def _listeners(settings: WireSettings) -> list[str]:
    """Return the endpoints to listen on: what nobody asked for is left to whoever holds it already.

    A router has to have them all: nobody else would be found there.
    """
    demanded = [settings.mode == "router" or settings.on_purpose(where) for where in settings.listen]
    return [
        where if is_demanded else f"{where}{';' if '#' in where else '#'}exit_on_failure=false"
        for where, is_demanded in zip(secured(settings.listen, settings.security), demanded, strict=True)
    ]


def _configuration(settings: WireSettings) -> dict[str, Any]:
    patience = settings.drop_after_ms * 1000
    return {
        "mode": settings.mode,
        "connect/endpoints": secured(settings.connect, settings.security),
        "connect/exit_on_failure": settings.mode == "client",
        "connect/timeout_ms": 5000 if settings.mode == "client" else -1,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2},
        "listen/endpoints": [] if settings.mode == "client" else _listeners(settings),
        "listen/exit_on_failure": True,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": settings.lease_ms,
        "transport/link/tx/queue/size/data": 8,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": patience,
        "transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments": 2 * patience,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": settings.lease_ms * 1000,
        **security_configuration(settings.security),
    }
