"""A router: a session that only passes messages on, and tells in the log whom it turned away."""

import logging
import os
import re
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh

from odom.wire.session import open_session
from odom.wire.settings import WireSettings

log = logging.getLogger(__name__)

_FILTER = "warn,zenoh::net::routing::interceptor::access_control=trace"
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_LINE = re.compile(
    r"\S+\s+(?P<level>[A-Z]+)\s+(?:(?P<thread>rx-\d+|\S*?) )?ThreadId\(\d+\) (?P<target>\S+?): (?P<text>.*)"
)
_DECISION = re.compile(r"on (?P<link>\S+) is (?P<un>un)?authorized to (?P<action>.+?) \(ingress\) on (?P<key>\S+)")
_NAME = re.compile(r"(?:CertCommonName|Username)\((.*?)\)")
_HELD_S = 1.0
_MOST = 1000


def run_router(settings: WireSettings, stop: threading.Event) -> None:
    """Route until `stop` is set."""
    with refusals_logged(), open_session(settings):
        log.info("routing at %s%s", ", ".join(settings.listen), ", by rules" if settings.security.access else "")
        stop.wait()


class Refusals:
    """Turns Zenoh's own log lines into this project's, each refusal once.

    Zenoh decides about a declared key once for all kinds of messages ("caching permissions"), whether or not they are
    ever sent: there only a refused `Put` counts, and not where the same identity then subscribes to that key.
    """

    def __init__(self) -> None:
        self._cached_key: dict[str, str] = {}
        self._held: dict[tuple[str, str], float] = {}
        self._told: set[tuple[str, str, str]] = set()

    def line(self, raw: str) -> None:
        """Take in one line."""
        found = _LINE.match(_COLOUR.sub("", raw))
        if found is None:
            return
        if found["target"].endswith("access_control"):
            self._access(found["thread"] or "", found["text"])
        elif found["level"] in ("WARN", "ERROR"):
            log.warning("%s", found["text"].removesuffix(" Hint: increase the system open file limit."))

    def _access(self, thread: str, text: str) -> None:
        if text.startswith("ACL (ingress): caching permissions for"):
            self._cached_key[thread] = text.split("`")[1]
            return
        decision = _DECISION.search(text)
        if decision is None:
            if text.startswith("ACL"):
                self._cached_key.pop(thread, None)
            return
        name = _NAME.search(decision["link"])
        who = name[1] if name else "a stranger"
        action, key = decision["action"], decision["key"].strip("`")
        in_cache = self._cached_key.get(thread) == key
        if in_cache and decision["un"] and action == "Put":
            self._held[who, key] = time.monotonic()
        elif not in_cache and "Subscriber" in action:
            self._held.pop((who, key), None)
            if decision["un"]:
                self._tell(who, "subscribe to", key)
        elif not in_cache and decision["un"]:
            self._tell(who, "publish" if action in ("Put", "Delete") else action.lower(), key)

    def flush(self, now: float) -> None:
        """Tell of what was held back long enough."""
        for (who, key), since in list(self._held.items()):
            if now - since > _HELD_S:
                del self._held[who, key]
                self._tell(who, "publish", key)

    def _tell(self, who: str, action: str, key: str) -> None:
        if (who, action, key) in self._told:
            return
        if len(self._told) >= _MOST:
            self._told.clear()
        self._told.add((who, action, key))
        log.warning("refused: %s may not %s %s", who, action, key)


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
                refusals.flush(time.monotonic())

    thread = threading.Thread(target=read, name="zenoh-log", daemon=True)
    thread.start()
    zenoh.init_log_from_env_or(_FILTER)
    try:
        yield
    finally:
        os.dup2(own, 1)
        os.close(own)
        thread.join(timeout=1)
        refusals.flush(float("inf"))
