"""Counts the messages that cannot be used, by key, and reports keys that are flooded with them."""

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable

_LOG = logging.getLogger(__name__)

_FLOOD_COUNT = 32
"""Malformed messages on one key within a period that make a flood: just more than a camera of 30 Hz could send by
mistake. Smaller: such a camera is ignored as a flood; larger: a flood costs more CPU before it is ignored."""
_FLOOD_PERIOD_S = 1.0
"""Seconds over which they are counted, and for which the key is then ignored. Longer: an honest sender on that key is
heard later; shorter: more of the flood is decoded. Chosen by hand."""


class MalformedCounter:
    """Counts refused messages by key and logs the first of each key; safe to share between threads.

    A key on which 32 messages were refused within a second counts as flooded for the next second.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.counts: Counter[str] = Counter()
        self._clock = clock
        self._lock = threading.Lock()
        self._last: dict[str, deque[float]] = {}

    def add(self, key: str, why: str) -> None:
        """Count a message that was decoded and could not be used."""
        now = self._clock()
        with self._lock:
            if not self.counts[key]:
                _LOG.warning("%s: dropped a message that cannot be used (further ones are only counted): %s", key, why)
            self.counts[key] += 1
            self._last.setdefault(key, deque(maxlen=_FLOOD_COUNT)).append(now)

    def flooded(self) -> frozenset[str]:
        """Return the keys that are flooded at this moment."""
        if not self._last:
            return frozenset()
        now = self._clock()
        with self._lock:
            return frozenset(key for key, times in self._last.items() if _is_flood(times, now))

    def ignore(self, counts: Counter[str]) -> None:
        """Count messages that were not looked at because their key is flooded."""
        with self._lock:
            self.counts.update(counts)


def _is_flood(times: deque[float], now: float) -> bool:
    in_a_period = len(times) == _FLOOD_COUNT and times[-1] - times[0] < _FLOOD_PERIOD_S
    return in_a_period and now < times[-1] + _FLOOD_PERIOD_S
