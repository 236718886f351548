"""Where the time of a frame goes."""

import time
from collections.abc import Mapping


class Stopwatch:
    """Laps of one frame's processing, in milliseconds of wall time by stage."""

    def __init__(self, laps_ms: Mapping[str, float] | None = None) -> None:
        """Begin now, on top of the laps that were done before."""
        self.laps_ms = dict(laps_ms or {})
        self._since = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to `stage`."""
        now = time.perf_counter()
        self.laps_ms[stage] = self.laps_ms.get(stage, 0.0) + 1e3 * (now - self._since)
        self._since = now
