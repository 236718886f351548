"""Telling a process that has nothing to do from one that is at work, or too busy to report."""

import time

_LONGEST_S, _REPORTS = 5.0, 10


class Idling:
    """Whether one that reports several times a second, but not while it saves, has had nothing to do for five seconds.

    A silent one may be at work: ten reports must have come since it was last seen to be.
    """

    def __init__(self) -> None:
        self.works()

    def works(self) -> None:
        """Take note that it is at work."""
        self._worked_at, self._reports = time.monotonic(), 0

    def reports(self) -> None:
        """Take note of one more report."""
        self._reports += 1

    @property
    def is_long(self) -> bool:
        """Whether it has been idle for long enough to be taken for done."""
        return self._reports >= _REPORTS and time.monotonic() - self._worked_at > _LONGEST_S
