"""Warns when two processes do the same job for one device: their messages would alternate for no visible reason.

Beside the token of its role, `<ns>/alive/odometry`, a process declares one of its own, `<ns>/alive/odometry/HOST-PID`.
"""

import os
import re
import socket
import threading
from collections.abc import Callable

from odom.wire.session import WireSession
from odom.wire.topics import Topics

JOBS = {"sensor": ("sensors send images", "images"), "odometry": ("odometry processes publish poses", "poses")}
"""What is reported about several processes of a role."""
PATIENCE_S = 5.0
"""How long several are tolerated before the warning. Shorter: a dead process seems to live on beside its successor for
the lease of its link, 2 s by default; longer: poses of two are mixed for longer before the warning."""
_NOT_IN_A_KEY = re.compile(r"[^A-Za-z0-9_.-]")


class Namesakes:
    """The living processes of `role` (`sensor`, `odometry`) of one device, this one among them if `is_one`.

    When there are several for 5 s, `tell` is called once, from another thread, with all their names and what to do;
    again when another one has come.
    """

    def __init__(
        self,
        session: WireSession,
        topics: Topics,
        role: str,
        tell: Callable[[str], None],
        is_one: bool = True,
    ) -> None:
        self._device, self._role, self._tell = topics.namespace, role, tell
        self._prefix = f"{topics.alive_of(role)}/"
        self._lock = threading.Lock()
        self._names: set[str] = set()
        self._told: frozenset[str] = frozenset()
        self._timer: threading.Timer | None = None
        session.at_close(self._cancel)
        session.watch(f"{self._prefix}*", self._changed)
        if is_one:
            session.announce(f"{self._prefix}{_NOT_IN_A_KEY.sub('_', socket.gethostname())}-{os.getpid()}")

    @property
    def conflict(self) -> str:
        """What was told, empty while at most one process does the job."""
        with self._lock:
            names = sorted(self._names)
            if len(names) < 2 or not self._told:
                return ""
        what, messages = JOBS[self._role]
        return (
            f"{len(names)} {what} as {self._device}: {', '.join(names)}; their {messages} alternate. "
            "End all but one, or give each a --namespace of its own"
        )

    def _changed(self, key: str, alive: bool) -> None:
        name = key.removeprefix(self._prefix)
        with self._lock:
            (self._names.add if alive else self._names.discard)(name)
            if len(self._names) > 1 and self._timer is None and not self._names <= self._told:
                self._timer = threading.Timer(PATIENCE_S, self._look)
                self._timer.daemon = True
                self._timer.start()

    def _look(self) -> None:
        with self._lock:
            self._timer = None
            if len(self._names) < 2 or self._names <= self._told:
                return
            self._told = frozenset(self._names)
        self._tell(self.conflict)

    def _cancel(self) -> None:
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
