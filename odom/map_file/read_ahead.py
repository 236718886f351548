"""Key frames read from disk before they are asked for, in a thread: whether one was or not changes no result."""

import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor

from odom.backend.map.saved import SavedDetails

_MOST = 32
"""Key frames that are read ahead, some .3 MB each; beyond, the first asked for is read again when it is wanted."""


class ReadAhead:
    """Reads key frames by their numbers with `read`, now or ahead."""

    def __init__(self, read: Callable[[int], SavedDetails | None]) -> None:
        self._read = read
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="odom-map-reader")
        self._lock = threading.Lock()
        self._coming: dict[int, Future[SavedDetails | None]] = {}
        self.is_closed = False
        """Whether nothing more is read ahead: who asks on has missed the end."""

    def ask(self, numbers: Iterable[int]) -> None:
        """Begin to read key frames that may soon be wanted."""
        with self._lock:
            if self.is_closed:
                return
            for number in numbers:
                if number not in self._coming:
                    self._coming[number] = self._pool.submit(self._read, number)
            for number in list(self._coming)[:-_MOST]:
                self._coming.pop(number).cancel()

    def get(self, number: int) -> SavedDetails | None:
        """Return what was read ahead, or read it now."""
        with self._lock:
            coming = self._coming.pop(number, None)
        return self._read(number) if coming is None or coming.cancel() else coming.result()

    def forget(self, numbers: Iterable[int]) -> None:
        """Drop what was read ahead of key frames that are other now."""
        with self._lock:
            for number in numbers:
                if coming := self._coming.pop(number, None):
                    coming.cancel()

    def close(self) -> None:
        """Read nothing more ahead."""
        with self._lock:
            self.is_closed = True
        self._pool.shutdown(cancel_futures=True)
