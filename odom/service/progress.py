"""Progress of a command: a bar on a terminal, a line every few seconds elsewhere, counts for a parent `odom run`."""

import json
import logging
import os
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from odom.service.log_form import as_json, is_json

COUNT_ENVIRONMENT = "ODOM_COUNT"
"""Set by `odom run` for its children, which then print counts and reports to stdout, to be parsed there."""

_LOG = logging.getLogger(__name__)
_COUNT, _REPORT = "@count", "@report"
_COUNT_PERIOD_S = 0.5
"""Between two counts for the `odom run` above: longer makes its bar jerky, shorter only costs lines."""
_LINE_PERIOD_S = 5.0
"""Between two lines where there is no terminal: shorter fills log files, longer leaves people in doubt."""


@dataclass(frozen=True)
class Reading:
    """How far a command is: `frames` done of `total`, a second, and its state with the reason."""

    frames: int
    total: int | None
    fps: float
    state: str
    reason: str = ""
    unit: str = "frames"


class Display(ABC):
    """Shows readings and the output of the children."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        return None

    @abstractmethod
    def show(self, reading: Reading) -> None:
        """Show how far the run is."""

    @abstractmethod
    def say(self, name: str, line: str) -> None:
        """Show a line of the output of the child `name`."""


def open_display(what: str = "") -> Display:
    """Return the display that suits stderr; log lines, whatever stderr is, where these are JSON.

    What shows nothing but the progress of `what` leaves no bar behind, and writes no line for a short command.
    """
    return Bar(what) if sys.stderr.isatty() and not as_json() else Lines(as_json(), what)


class Bar(Display):
    """A progress bar below the output of the children."""

    def __init__(self, what: str = "") -> None:
        self._console = Console(stderr=True, soft_wrap=True)
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[count]}, {task.fields[fps]:.0f}/s"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=bool(what),
        )
        self._task: TaskID = self._progress.add_task(what or "starting", total=None, count="0", fps=0.0)

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._progress.stop()

    def show(self, reading: Reading) -> None:
        """Show how far the run is."""
        count = f"{reading.frames}/{reading.total}" if reading.total else str(reading.frames)
        self._progress.update(
            self._task, completed=reading.frames, total=reading.total, description=reading.state,
            count=f"{count} {reading.unit}", fps=reading.fps,
        )  # fmt: skip

    def say(self, name: str, line: str) -> None:
        """Show a line that the child `name` wrote."""
        self._console.print(f"[{name}] {line}", markup=False, highlight=False)


class Lines(Display):
    """Lines on stderr, plain or logged: every few seconds and whenever the state changes."""

    def __init__(self, logged: bool = False, what: str = "") -> None:
        self._logged = logged
        self._due = time.monotonic() + _LINE_PERIOD_S if what else 0.0
        self._state = what

    def show(self, reading: Reading) -> None:
        """Show how far the run is."""
        now = time.monotonic()
        if now < self._due and reading.state == self._state:
            return
        self._due, self._state = now + _LINE_PERIOD_S, reading.state
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


@contextmanager
def counting(what: str, total: int | None, unit: str = "frames") -> Iterator[Callable[[int], None]]:
    """Yield a function to call with the number done so far, which shows `what` is done on stderr."""
    if os.environ.get(COUNT_ENVIRONMENT) == "1":
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
    """Write a report to stdout for the parent `odom run`, if there is one: it then has it even if the disk is full."""
    if os.environ.get(COUNT_ENVIRONMENT) == "1":
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
