"""Tells a process that has nothing to do from one that is at work, or too busy to report."""

import time

_IDLE_AFTER_S = 5.0
"""Seconds without work after which a process counts as idle.

Smaller: a process that only pauses is taken for done; larger: `odom run` and the recorder end later. Chosen by hand.
"""
_ENOUGH_REPORTS = 10
"""Reports that must have come in that time, since a silent process may be at work. Status comes several times a
second. Smaller: a process that saves its results may be taken for done; larger: the end is noticed later."""


class IdleDetector:
    """Watches a process that reports several times a second, except while it saves its results."""

    def __init__(self) -> None:
        self.note_work()

    def note_work(self) -> None:
        """Note that the process has just done something."""
        self._worked_at, self._reports = time.monotonic(), 0

    def note_report(self) -> None:
        """Note one more status report of the process."""
        self._reports += 1

    @property
    def is_idle(self) -> bool:
        """Whether the process has had nothing to do for five seconds, although it reported."""
        return self._reports >= _ENOUGH_REPORTS and time.monotonic() - self._worked_at > _IDLE_AFTER_S
