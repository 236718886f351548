"""Logs once when no ROS 2 router answers, and once when one does."""

import logging
import threading

import zenoh

_LOG = logging.getLogger(__name__)
_PATIENCE_S = 2.0
"""Seconds without a router until the log line. Shorter: one that starts at the same time is called missing; longer: the
user looks for the topics in vain for longer."""
_POLL_S = 0.2
"""Seconds between two looks; each takes some microseconds."""


class RouterWatch:
    """Looks, in a thread, whether a session has met a router or another node, until it has."""

    def __init__(self, session: zenoh.Session, endpoint: str) -> None:
        self._session, self._endpoint = session, endpoint
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._look, name="ros2 router", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop looking."""
        self._closed.set()
        self._thread.join()

    def _look(self) -> None:
        waited, is_told = 0.0, False
        while not self._is_met():
            if self._closed.wait(_POLL_S):
                return
            waited += _POLL_S
            if waited >= _PATIENCE_S and not is_told:
                is_told = True
                _LOG.warning(
                    "no ROS 2 router answers at %s: start one (ros2 run rmw_zenoh_cpp rmw_zenohd, or odom router), or "
                    "name another by wire.ros2_router; until then all goes on unseen by ROS 2",
                    self._endpoint,
                )
        if is_told:
            _LOG.info("the ROS 2 router at %s has come", self._endpoint)

    def _is_met(self) -> bool:
        info = self._session.info
        return bool(info.routers_zid() or info.peers_zid())
