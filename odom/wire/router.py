"""A router: a session that only passes messages on, and tells in the log whom it turned away."""

import logging
import os
import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh

from odom.wire.session import open_session
from odom.wire.settings import WireSettings

log = logging.getLogger(__name__)

_FILTER = (
    "warn,zenoh_transport::unicast::establishment::accept=debug,zenoh::net::routing::interceptor::access_control=trace"
)
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_IDENTITY = re.compile(r"(\w+) on \S*(?:CertCommonName|Username)\((.*?)\)")
_REFUSED = re.compile(r"(\w+)(?: on \S+)? is unauthorized to (.+?) \(ingress\) on (\S+)")
_PASSWORD = re.compile(r"UsrPwd extension - Recv \w+\. (.*?)\.? at ")
_WARNING = re.compile(r"\S+ +(?:WARN|ERROR) .*?ThreadId\(\d+\) \S+: (.*)")
_THREAD = re.compile(r"ThreadId\(\d+\)")
_VERBS = {"Put": "publish", "Delete": "publish", "Declare Subscriber": "subscribe to"}
_MOST = 1000


def run_router(settings: WireSettings, stop: threading.Event) -> None:
    """Route until `stop` is set."""
    with refusals_logged(), open_session(settings):
        log.info("routing at %s%s", ", ".join(settings.listen), ", by rules" if settings.security.access else "")
        stop.wait()


class Refusals:
    """Turns Zenoh's own log lines into this project's, each refusal once.

    Zenoh first decides about a declared key for all kinds of messages ("caching permissions"), whether or not they will
    ever be sent, and says "Using cached result" when one is: those first decisions only tell who is who.
    """

    def __init__(self) -> None:
        self._names: dict[str, str] = {}
        self._deciding_ahead: set[str] = set()
        self._told: set[str] = set()

    def line(self, raw: str) -> None:
        """Take in one line; quick for the many that say nothing of interest."""
        if "caching permissions" in raw:
            self._deciding_ahead.add(_thread(raw))
        elif "authorized to" in raw:
            self._decision(raw)
        elif "UsrPwd extension" in raw:
            if found := _PASSWORD.search(_COLOUR.sub("", raw)):
                log.warning("refused: a client (%s)", found[1].lower())
        elif found := _WARNING.match(_COLOUR.sub("", raw)):
            log.warning("%s", found[1].removesuffix(" Hint: increase the system open file limit."))

    def _decision(self, raw: str) -> None:
        cached = "Using cached result" in raw
        if not cached:
            if (found := _IDENTITY.search(raw)) and len(self._names) < _MOST:
                self._names[found[1]] = found[2]
            # The decisions ahead end with this kind of message, once for each direction.
            thread = _thread(raw)
            if thread in self._deciding_ahead:
                if "Declare Liveliness Subscriber" in raw:
                    self._deciding_ahead.discard(thread)
                return
        if "unauthorized" not in raw or not (refused := _REFUSED.search(_COLOUR.sub("", raw))):
            return
        who = self._names.get(refused[1], "a stranger")
        told = f"{who} may not {_VERBS.get(refused[2], refused[2].lower())} {refused[3]}"
        if told not in self._told:
            if len(self._told) >= _MOST:
                self._told.clear()
            self._told.add(told)
            log.warning("refused: %s", told)


def _thread(raw: str) -> str:
    found = _THREAD.search(raw)
    return found[0] if found else ""


@contextmanager
def refusals_logged() -> Iterator[None]:
    """Read Zenoh's log, which it writes to the standard output, and log what matters; nothing else may be printed."""
    sys.stdout.flush()
    own = os.dup(1)
    reading, writing = os.pipe()
    os.dup2(writing, 1)
    os.close(writing)
    refusals = Refusals()

    def read() -> None:
        with os.fdopen(reading, errors="replace") as lines:
            for line in lines:
                refusals.line(line)

    thread = threading.Thread(target=read, name="zenoh-log", daemon=True)
    thread.start()
    zenoh.init_log_from_env_or(_FILTER)
    try:
        yield
    finally:
        os.dup2(own, 1)
        os.close(own)
        thread.join(timeout=1)
