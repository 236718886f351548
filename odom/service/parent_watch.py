"""A child of `odom run` ends when its parent is gone."""

import os
import signal
import threading
import time

PARENT_ENVIRONMENT = "ODOM_PARENT_PID"
"""Environment variable in which `odom run` tells a child its process id."""
_POLL_S = 0.5
"""Time between two checks whether the parent is alive: a child may outlive a killed `odom run` by as much."""


def end_with_parent() -> None:
    """Send this process a SIGTERM when the `odom run` that started it is gone, even by kill -9."""
    parent = os.environ.pop(PARENT_ENVIRONMENT, None)
    if parent is None:
        return

    def watch() -> None:
        while os.getppid() == int(parent):
            time.sleep(_POLL_S)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()
