"""Tells a user why a process shows nothing: nothing has come, and who is seen on the wire."""

import logging
import time

from odom.wire.session import WireSession
from odom.wire.topics import Topics

_LOG = logging.getLogger(__name__)
_FIRST_S = 5.0
"""Seconds without any message until it is told. Shorter: also of a sensor that is only starting; longer: users have
begun to look for the fault themselves."""
_AGAIN_S = 60.0
"""Seconds between two such lines. Shorter: a log of little else; longer: a network that was mended is seen later."""


class Unheard:
    """Logs, after five seconds and then each minute, that nothing has come; `look` is called often until it has.

    It is no warning while the sensor is there and its odometry is not: that may be compiling, and many sensors wait.
    """

    def __init__(self, session: WireSession, topics: Topics) -> None:
        self._session, self._topics = session, topics
        self._due = time.monotonic() + _FIRST_S

    def look(self) -> None:
        """Log it if it is time to."""
        if time.monotonic() < self._due:
            return
        self._due = time.monotonic() + _AGAIN_S
        living = self._session.living("**/alive")
        if self._topics.alive in living and not self._session.living(self._topics.ack_of("odometry")):
            _LOG.info("nothing has come for %s yet: its sensor is here, an odometry is not", self._topics.namespace)
            return
        seen = sorted(key.removesuffix("/alive") for key in living)
        _LOG.warning(
            "nothing has come for %s (sensors seen: %s; connected: %s)",
            self._topics.namespace,
            ", ".join(seen) or "none",
            "yes" if self._session.is_connected else "no",
        )
