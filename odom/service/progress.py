"""Progress of a command: a bar on a terminal, a line every few seconds elsewhere, counts for a parent `odom run`."""

import json
import logging
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from odom.service.display import Display as Display
from odom.service.display import Reading as Reading
from odom.service.log_form import as_json, is_json

COUNT_ENVIRONMENT = "ODOM_COUNT"
"""Set by `odom run` for its children, which then print counts and reports to stdout, to be parsed there."""

_LOG = logging.getLogger(__name__)
_COUNT, _REPORT = "@count", "@report"
_COUNT_PERIOD_S = 0.5
"""Between two counts for the `odom run` above: longer makes its bar jerky, shorter only costs lines."""
_LINE_PERIOD_S = 5.0
"""Between two lines where there is no terminal: shorter fills log files, longer leaves people in doubt."""
_CHANGE_PERIOD_S = 1.0
"""The same where the state changes: one that alternates from frame to frame would fill log files, too."""


def open_display(what: str = "") -> Display:
    """Return the display that suits stderr; log lines, whatever stderr is, where these are JSON.

    A display of nothing but the progress of `what` removes its bar at the end, and writes no line for a short command.
    """
    if as_json() or not sys.stderr.isatty():
        return Lines(as_json(), what)
    from odom.service.progress_bar import Bar

    return Bar(what)


class Lines(Display):
    """Lines on stderr, plain or logged: every few seconds and when the state changes."""

    def __init__(self, logged: bool = False, what: str = "") -> None:
        self._logged = logged
        self._due = time.monotonic() + _LINE_PERIOD_S if what else 0.0
        self._change_due, self._state = 0.0, what

    def show(self, reading: Reading) -> None:
        """Show how far the run is."""
        now = time.monotonic()
        if now < self._due and (reading.state == self._state or now < self._change_due):
            return
        self._due, self._change_due, self._state = now + _LINE_PERIOD_S, now + _CHANGE_PERIOD_S, reading.state
        of, eta = "", ""
        if reading.total:
            of = f"/{reading.total}"
            if reading.fps > 0:
                eta = f", {max(reading.total - reading.frames, 0) / reading.fps:.0f} s to go"
        why = f" ({reading.reason})" if reading.reason else ""
        text = f"{reading.frames}{of} {reading.unit}, {reading.fps:.0f}/s, {reading.state}{why}{eta}"
        if self._logged:
            _LOG.info("%s", text)
        else:
            _put_line(text)

    def say(self, name: str, line: str) -> None:
        """Show a line that the child `name` wrote."""
        if self._logged and not is_json(line):
            logging.getLogger(name).info("%s", line)
        else:
            _put_line(line if self._logged else f"[{name}] {line}")


def _put_line(text: str) -> None:
    """Write a line to stderr in one piece: others write there at the same time."""
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()


def is_in_a_run() -> bool:
    """Return whether this process is a child of `odom run`, which reads what it prints and says how all went."""
    return os.environ.get(COUNT_ENVIRONMENT) == "1"


@contextmanager
def counting(what: str, total: int | None, unit: str = "frames") -> Iterator[Callable[[int], None]]:
    """Yield a function to call with the number done so far, which shows the progress of `what` on stderr."""
    if is_in_a_run():
        yield CountLines(total).show
        return
    begun = time.monotonic()
    with open_display(what) as display:
        yield lambda done: display.show(Reading(done, total, done / (time.monotonic() - begun), what, unit=unit))


class CountLines:
    """Writes counts to stdout for the parent `odom run`."""

    def __init__(self, total: int | None) -> None:
        self._total = "-" if total is None else str(total)
        self._due = 0.0
        self.show(0)

    def show(self, done: int) -> None:
        """Write a line, at most two a second."""
        now = time.monotonic()
        if now >= self._due:
            self._due = now + _COUNT_PERIOD_S
            sys.stdout.write(f"{_COUNT} {done} {self._total}\n")
            sys.stdout.flush()


def parse_count(line: str) -> tuple[int, int | None] | None:
    """Return (done, total if known) of a line of `CountLines`, None for any other line."""
    word, *numbers = line.split(" ")
    if word != _COUNT or len(numbers) != 2:
        return None
    try:
        return int(numbers[0]), int(numbers[1]) if numbers[1] != "-" else None
    except ValueError:
        return None


def hand_up(report: Mapping[str, object]) -> None:
    """Write a report to stdout for the parent `odom run`, if there is one: so it arrives even if the disk is full."""
    if is_in_a_run():
        sys.stdout.write(f"{_REPORT} {json.dumps(report)}\n")
        sys.stdout.flush()


def parse_report(line: str) -> dict[str, Any] | None:
    """Return the report in a line of `hand_up`, None for any other line."""
    if not line.startswith(f"{_REPORT} "):
        return None
    try:
        report = json.loads(line.removeprefix(_REPORT))
    except ValueError:
        return None
    return report if isinstance(report, dict) else None
