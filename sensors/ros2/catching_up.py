"""Hands out images received while a source was starting, faster than their own rate, until it is up to date."""

import time
from collections import deque

from odom.wire import Message
from odom.wire.ros2.inbox import Inbox

AT_START = 60
"""Messages of a topic that may wait until the source has begun: 2 s at 30 Hz. Fewer: a slow start loses the first
images; more: the first poses come later."""
_SPEED = 1.5
"""Times faster than they were taken images are handed out that waited. Faster: the odometry, which takes the newest,
leaves some out; slower: it stays behind for longer."""
_LONGEST_S = 0.1
"""Longest wait for the time of a message, in seconds, whatever its stamp says."""


class CatchingUp:
    """Messages of an inbox, of which `AT_START` of a topic may have waited, and from now on `depth` may.

    Those that waited come one after another. If some were dropped already, only the newest come: then the beginning is
    lost anyway.
    """

    def __init__(self, inbox: Inbox, depth: int) -> None:
        self._inbox = inbox
        self._behind: deque[Message] = deque()
        self._last: tuple[float, Message] | None = None
        if not inbox.counts["dropped"]:
            self._fetch()
        inbox.limit(depth)

    def receive(self, timeout: float) -> Message | None:
        """Return the next message; None after `timeout` s or when the inbox is closed."""
        if not self._behind:
            return self._inbox.receive(timeout)
        self._fetch()
        message = self._behind.popleft()
        if self._last is not None:
            then, last = self._last
            due = then + (message.stamp - last.stamp) / 1e9 / _SPEED
            time.sleep(min(max(0.0, due - time.monotonic()), _LONGEST_S))
        self._last = time.monotonic(), message
        return message

    def _fetch(self) -> None:
        while (message := self._inbox.receive(0.0)) is not None:
            self._behind.append(message)
