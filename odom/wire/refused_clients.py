"""Which clients a router refused and why, in plain words, read from Zenoh's own log.

Zenoh 1.10 offers events for links and sessions that were opened, but none for those that were refused and none for its
access control. The format of the log is no promise: tests/field/test_security.py checks it with the installed version.
"""

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

_LOG = logging.getLogger(__name__)

# what Zenoh's log is asked for, the parts of its lines, and what its texts mean
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

_MOST_CLIENTS = 1000
"""Clients that are remembered, the newest; a bound against a flood of them. Smaller: a client of a large rig may be
named `a client` only."""
_MOST_KINDS = 50
"""Kinds of refusals that are logged for a client, each at its 1st, 10th, 100th ... time; further kinds count as one. A
bound against a client that tries invented keys. Larger: it can fill the log."""


class RefusedClients:
    """Turns lines of Zenoh's log into lines of this project's log.

    Zenoh knows the address of a client only once its link is open: a failed TLS handshake has none. It decides about a
    key that is declared for all kinds of messages at once ("caching permissions"), whether or not they will ever be
    sent, and says "Using cached result" when one is sent: from the first decisions only the names are taken.
    """

    def __init__(self) -> None:
        self._certificates: dict[str, str] = {}
        self._addresses: dict[str, str] = {}
        self._names: dict[str, str] = {}
        self._deciding_ahead: set[str] = set()
        self._times: dict[str, Counter[str]] = {}

    def line(self, raw: str) -> None:
        """Take in one line; quick for the many lines that say nothing of interest."""
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
        """Take in a step of opening a link; one thread logs all steps of a link, one after the other."""
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
        fault = next((words for said, words in _TLS_FAULTS.items() if text.startswith(said)), None)
        if fault is not None and "zenoh_link_tls" in origin:
            self._refuse("a client", f"{fault} ({text.rstrip('.')})")
        else:
            _LOG.warning("%s", text)

    def _decision(self, raw: str) -> None:
        if "Using cached result" not in raw:
            if found := _IDENTITY.search(raw):
                _remember(self._names, found[1], found[2])
            # the decisions ahead end with this kind of message, once for each direction
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
        what = what if what in times or len(times) < _MOST_KINDS else _OTHERS
        times[what] += 1
        count = times[what]
        if count == 10 ** (len(str(count)) - 1):
            _LOG.warning("refused: %s %s%s", who, what, f", {count} times by now" if count > 1 else "")


def _thread(raw: str) -> str:
    found = _THREAD.search(raw)
    return found[0] if found else ""


def _remember(known: dict[str, Value], key: str, value: Value) -> None:
    """Put an entry at the end, and forget the oldest one of too many."""
    known.pop(key, None)
    known[key] = value
    if len(known) > _MOST_CLIENTS:
        del known[next(iter(known))]


@contextmanager
def refused_clients_logged() -> Iterator[None]:
    """Read Zenoh's log, which it writes to the standard output, and log what matters; print nothing else meanwhile."""
    sys.stdout.flush()
    own = os.dup(1)
    reading, writing = os.pipe()
    os.dup2(writing, 1)
    os.close(writing)
    clients = RefusedClients()

    def read() -> None:
        with os.fdopen(reading, errors="replace") as lines:
            for line in lines:
                clients.line(line)

    thread = threading.Thread(target=read, name="zenoh-log", daemon=True)
    thread.start()
    zenoh.init_log_from_env_or(_FILTER)
    try:
        yield
    finally:
        os.dup2(own, 1)
        os.close(own)
        thread.join(timeout=1)
