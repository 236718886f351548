"""Replaces a recorder that is gone, for which the source would wait."""

import time
from typing import Any

from odom.wire.session import WireSession

_SEEN_S = 2.0
"""Time for a sender to find a new consumer: if shorter, it waits for ever; longer delays the run."""


class StandIn:
    """Takes the place of a recorder that died early: a source that was told to wait for two consumers finds both.

    It acknowledges nothing, so it leaves again once the sender has had the time to see it.
    """

    def __init__(self, session: WireSession, key: str) -> None:
        self._session = session
        self._key = key
        self._token: Any = None
        self._leaves_at: float | None = None
        self._has_left = False

    def step(self, both_are_here: bool) -> None:
        """Join at the first call; leave two seconds after the first call at which sender and odometry are there."""
        if self._has_left:
            return
        if self._token is None:
            self._token = self._session.zenoh.liveliness().declare_token(self._key)
        if both_are_here and self._leaves_at is None:
            self._leaves_at = time.monotonic() + _SEEN_S
        if self._leaves_at is not None and time.monotonic() >= self._leaves_at:
            self.leave()

    def leave(self) -> None:
        """Leave; safe to call twice."""
        self._has_left = True
        token, self._token = self._token, None
        if token is not None:
            token.undeclare()
