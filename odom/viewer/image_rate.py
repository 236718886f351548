"""Limits how many images a second are shown."""

from odom.frame import Stamp

_PAIR_NS = 20_000_000
"""Colour and depth nearer than this are of one frame: more than half of a Kinect's 33 ms would pair neighbours."""


class ImageRateLimit:
    """Takes at most `rate_hz` frames a second of wall time, colour and depth of a frame together or neither."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._due_s = 0.0
        self._stamp: Stamp | None = None
        self._kinds: set[str] = set()
        self.thinned = 0

    def takes(self, kind: str, stamp: Stamp, now_s: float) -> bool:
        """Return whether to show an image of `kind` captured at `stamp`, at the wall time `now_s`."""
        partner = self._stamp is not None and abs(stamp - self._stamp) <= _PAIR_NS
        if partner and kind not in self._kinds:
            self._kinds.add(kind)
            return True
        if now_s < self._due_s:
            self.thinned += 1
            return False
        self._due_s = max(self._due_s + self._period_s, now_s)
        self._stamp, self._kinds = stamp, {kind}
        return True
