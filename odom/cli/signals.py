"""How a process is asked to end: SIGINT and SIGTERM set an event, a second one ends it at once."""

import os
import signal
import threading
import time
from types import FrameType

PARENT_ENVIRONMENT = "ODOM_PARENT_PID"
_PARENT_POLL_S = 0.5


def stop_event() -> threading.Event:
    """Return an event that the first SIGINT or SIGTERM sets; the second has its default effect.

    Only the main thread may call this.
    """
    stop = threading.Event()

    def handle(number: int, frame: FrameType | None) -> None:
        stop.set()
        signal.signal(number, signal.SIG_DFL)

    signal.signal(signal.SIGINT, handle)
    signal.signal(signal.SIGTERM, handle)
    return stop


def end_with_parent() -> None:
    """Send this process a SIGTERM when the `odom run` that started it is gone, even by kill -9."""
    parent = os.environ.pop(PARENT_ENVIRONMENT, None)
    if parent is None:
        return

    def watch() -> None:
        while os.getppid() == int(parent):
            time.sleep(_PARENT_POLL_S)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()
