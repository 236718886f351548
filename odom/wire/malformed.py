"""What cannot be used, counted by key, and how a receiver knows that a key is flooded with it."""

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable

log = logging.getLogger(__name__)

_FLOOD = 32
_PERIOD_S = 1.0


class Malformed:
    """Counts refused messages by key and logs the first of each key; safe to share between threads.

    A key of which 32 messages were refused within a second is flooded for the second after.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.counts: Counter[str] = Counter()
        self._clock = clock
        self._lock = threading.Lock()
        self._periods: dict[str, tuple[float, int]] = {}
        self._flooded_until: dict[str, float] = {}

    def add(self, key: str, why: str) -> None:
        """Count a message that was looked at and could not be used."""
        now = self._clock()
        with self._lock:
            if not self.counts[key]:
                log.warning("%s: dropped what cannot be used (further ones are counted): %s", key, why)
            self.counts[key] += 1
            begun, refused = self._periods.get(key, (now, 0))
            begun, refused = (begun, refused + 1) if now - begun < _PERIOD_S else (now, 1)
            self._periods[key] = (begun, refused)
            if refused >= _FLOOD:
                self._flooded_until[key] = now + _PERIOD_S

    def flooded(self) -> frozenset[str]:
        """Return the keys that are flooded just now."""
        if not self._flooded_until:
            return frozenset()
        now = self._clock()
        with self._lock:
            return frozenset(key for key, until in self._flooded_until.items() if now < until)

    def ignore(self, counts: Counter[str]) -> None:
        """Count messages that were not looked at because their key is flooded."""
        with self._lock:
            self.counts.update(counts)
