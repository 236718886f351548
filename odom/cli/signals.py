"""Ends a process on request: the first SIGINT, SIGTERM or SIGHUP sets an event, the second ends it at once."""

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

T = TypeVar("T")

_POLL_S = 0.05
"""Longest time until a request to end is noticed."""


def stop_event() -> threading.Event:
    """Return an event that the first SIGINT or SIGTERM sets; the second has its default effect.

    So does SIGHUP, of a terminal that is closed, unless it is ignored (nohup). Only the main thread may call this.
    While the interpreter shuts down, SIGTERM and SIGHUP are ignored: they would replace the exit status, and a parent
    that has just asked for the end would take a failure for an end on request.
    """
    stop = threading.Event()

    def handle(number: int, frame: FrameType | None) -> None:
        stop.set()
        signal.signal(number, signal.SIG_DFL)

    signal.signal(signal.SIGINT, handle)
    for number in (signal.SIGTERM, signal.SIGHUP):
        if number == signal.SIGTERM or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handle)
        atexit.register(signal.signal, number, signal.SIG_IGN)
    return stop


@contextmanager
def as_ctrl_c() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise KeyboardInterrupt meanwhile, as SIGINT does, so that what was begun is cleaned up.

    SIGHUP stays ignored where it is (nohup). Only the main thread may call this.
    """
    numbers = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) != signal.SIG_IGN]
    handlers = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def before(stop: threading.Event, work: Callable[[], T]) -> T:
    """Return what `work` returns; if `stop` is set first, this process ends at once, with status 0.

    It is for work that may compile or wait for a device, and before which nothing was begun that had to be saved.
    """
    with ThreadPoolExecutor(1, "work") as pool:
        future = pool.submit(work)
        while not wait([future], _POLL_S).done:
            if stop.is_set():
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(0)  # whoever waits for the thread's end would wait for what was to be opened
        return future.result()
