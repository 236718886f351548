"""Whom a router turned away and why, in plain words, read from Zenoh's own log: it tells nobody otherwise."""

import logging
import os
import re
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import zenoh

Value = TypeVar("Value")

log = logging.getLogger(__name__)

_FILTER = (
    "warn,zenoh_link_tls=debug,zenoh_transport::unicast::establishment::accept=trace,"
    "zenoh::net::routing::interceptor::access_control=trace"
)
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_THREAD = re.compile(r"ThreadId\(\d+\)")
_WARNING = re.compile(r"\S+ +(?:WARN|ERROR) .*?ThreadId\(\d+\) (\S+): (.*)")
_CERTIFICATE = re.compile(r"Accepted TLS connection on \S+: (\S+)\. Common Name: (.*)\.")
_SYN = re.compile(r"Establishment Accept \w+Syn: \S+ => \w+/(\S+)\. Received")
_PASSWORD = re.compile(r"UsrPwd extension - Recv \w+\. (.*?)\.? at ")
_IDENTITY = re.compile(r"(\w+) on \S*(?:CertCommonName|Username)\((.*?)\)")
_UNAUTHORIZED = re.compile(r"(\w+)(?: on \S+)? is unauthorized to (.+?) \(ingress\) on (\S+)")

_PASSWORD_FAULTS = {
    "Invalid password": "whose password is wrong",
    "Invalid user": "whose user is not known here",
    "Expected extension": "that gives no user and password",
}
_TLS_FAULTS = {
    "received corrupt message": "that does not speak TLS",
    "peer sent no certificates": "that shows no certificate",
    "invalid peer certificate: Expired": "whose certificate has expired",
    "invalid peer certificate: NotValidYet": "whose certificate is not valid yet",
    "invalid peer certificate: BadSignature": "whose certificate another authority has signed",
    "invalid peer certificate: UnknownIssuer": "whose certificate another authority has signed",
    "invalid peer certificate": "whose certificate is not accepted",
    "received fatal alert": "that does not accept this router's certificate",
    "tls handshake eof": "that hung up before it showed a certificate",
}
_VERBS = {"Put": "publish", "Delete": "publish", "Declare Subscriber": "subscribe to"}
_HINT = " Hint: increase the system open file limit."
_OTHERS = "in many other ways"
_MOST, _MOST_EACH = 1000, 50


class Refusals:
    """Turns Zenoh's log lines into this project's: each refusal at its first, 10th, 100th ... time, 50 kinds a client.

    Zenoh names the address of a client only once its link stands: a failed TLS handshake has none. It first decides
    about a declared key for all kinds of messages ("caching permissions"), whether or not they will ever be sent, and
    says "Using cached result" when one is: those first decisions only tell who is who.
    """

    def __init__(self) -> None:
        self._certificates: dict[str, str] = {}
        self._addresses: dict[str, str] = {}
        self._names: dict[str, str] = {}
        self._deciding_ahead: set[str] = set()
        self._times: dict[str, Counter[str]] = {}

    def line(self, raw: str) -> None:
        """Take in one line; quick for the many that say nothing of interest."""
        if "caching permissions" in raw:
            self._deciding_ahead.add(_thread(raw))
        elif "authorized to" in raw:
            self._decision(raw)
        elif "::access_control" in raw or "::accept" in raw:
            self._link(_COLOUR.sub("", raw))
        elif "Accepted TLS" in raw:
            if found := _CERTIFICATE.search(_COLOUR.sub("", raw)):
                _remember(self._certificates, found[1], found[2])
        elif found := _WARNING.match(_COLOUR.sub("", raw)):
            self._warning(found[1], found[2].removesuffix(_HINT))

    def _link(self, line: str) -> None:
        """Take in a step of a link's making; all steps of one message stand together in a thread."""
        thread = _thread(line)
        if found := _SYN.search(line):
            _remember(self._addresses, thread, found[1])
        elif found := _PASSWORD.search(line):
            self._refuse(f"a client{self._at(thread)}", _PASSWORD_FAULTS.get(found[1], f"({found[1].lower()})"))
        elif "did not match any configured ACL subject" in line:
            name = self._certificates.get(self._addresses.get(thread, ""), "a client")
            self._refuse(f"{name}{self._at(thread)}", "is not among those allowed")

    def _at(self, thread: str) -> str:
        host, _, _ = self._addresses.get(thread, "").rpartition(":")
        return f" at {host}" if host else ""

    def _warning(self, origin: str, text: str) -> None:
        fault = next((told for said, told in _TLS_FAULTS.items() if text.startswith(said)), None)
        if fault is not None and "zenoh_link_tls" in origin:
            self._refuse("a client", f"{fault} ({text.rstrip('.')})")
        else:
            log.warning("%s", text)

    def _decision(self, raw: str) -> None:
        cached = "Using cached result" in raw
        if not cached:
            if found := _IDENTITY.search(raw):
                _remember(self._names, found[1], found[2])
            # The decisions ahead end with this kind of message, once for each direction.
            thread = _thread(raw)
            if thread in self._deciding_ahead:
                if "Declare Liveliness Subscriber" in raw:
                    self._deciding_ahead.discard(thread)
                return
        if "unauthorized" not in raw or not (refused := _UNAUTHORIZED.search(_COLOUR.sub("", raw))):
            return
        who = self._names.get(refused[1], "a stranger")
        self._refuse(who, f"may not {_VERBS.get(refused[2], refused[2].lower())} {refused[3]}")

    def _refuse(self, who: str, what: str) -> None:
        times = self._times.get(who, Counter())
        _remember(self._times, who, times)
        what = what if what in times or len(times) < _MOST_EACH else _OTHERS
        times[what] += 1
        count = times[what]
        if count == 10 ** (len(str(count)) - 1):
            log.warning("refused: %s %s%s", who, what, f", {count} times by now" if count > 1 else "")


def _thread(raw: str) -> str:
    found = _THREAD.search(raw)
    return found[0] if found else ""


def _remember(known: dict[str, Value], key: str, value: Value) -> None:
    """Keep the newest only."""
    known.pop(key, None)
    known[key] = value
    if len(known) > _MOST:
        del known[next(iter(known))]


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
