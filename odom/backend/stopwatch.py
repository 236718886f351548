"""Where the time of a frame goes."""

import time


class Stopwatch:
    """Laps of one frame's processing, in milliseconds of wall time by stage."""

    def __init__(self) -> None:
        self.laps_ms: dict[str, float] = {}
        self._since = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to `stage`."""
        now = time.perf_counter()
        self.laps_ms[stage] = self.laps_ms.get(stage, 0.0) + 1e3 * (now - self._since)
        self._since = now
