"""Ends a process on request: the first SIGINT or SIGTERM sets an event, the second ends it at once."""

import atexit
import signal
import threading
from types import FrameType


def stop_event() -> threading.Event:
    """Return an event that the first SIGINT or SIGTERM sets; the second has its default effect.

    Only the main thread may call this. While the interpreter shuts down, SIGTERM is ignored: it would replace the exit
    status, and a parent that has just asked for the end would take a failure for an end on request.
    """
    stop = threading.Event()

    def handle(number: int, frame: FrameType | None) -> None:
        stop.set()
        signal.signal(number, signal.SIG_DFL)

    signal.signal(signal.SIGINT, handle)
    signal.signal(signal.SIGTERM, handle)
    atexit.register(signal.signal, signal.SIGTERM, signal.SIG_IGN)
    return stop
