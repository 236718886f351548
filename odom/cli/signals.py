"""How a process is asked to end: SIGINT and SIGTERM set an event, a second one ends it at once."""

import signal
import threading
from types import FrameType


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
