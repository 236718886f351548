"""How far a command is: a bar on a terminal, a line now and then elsewhere, a count for the `odom run` above it."""

import logging
import sys
import time
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

COUNT_ENVIRONMENT = "ODOM_COUNT"
"""Set by `odom run` for its children: counts go to stdout as lines that `parse_count` reads."""

_LOG = logging.getLogger(__name__)
_COUNT = "@count"
_COUNT_PERIOD_S = 0.5
_LINE_PERIOD_S = 5.0


@dataclass(frozen=True)
class Reading:
    """What the last status message said."""

    frames: int
    total: int | None
    fps: float
    state: str
    reason: str = ""


class Display(Protocol):
    """Shows readings and passes on the words of the children."""

    def __enter__(self) -> Self: ...
    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Give the terminal back."""

    def show(self, reading: Reading) -> None:
        """Show how far the run is."""

    def say(self, name: str, line: str) -> None:
        """Show a line that the child `name` wrote."""


def open_display(logged: bool) -> Display:
    """Return the display that suits stderr; `logged`: lines for machines, whatever stderr is."""
    return Bar() if sys.stderr.isatty() and not logged else Lines(logged)


class Bar:
    """A progress bar below the lines of the children."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[count]} frames, {task.fields[fps]:.0f}/s"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
        )
        self._task: TaskID = self._progress.add_task("starting", total=None, count="0", fps=0.0)

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._progress.stop()

    def show(self, reading: Reading) -> None:
        """Show how far the run is."""
        count = f"{reading.frames}/{reading.total}" if reading.total else str(reading.frames)
        self._progress.update(
            self._task,
            completed=reading.frames,
            total=reading.total,
            description=reading.state,
            count=count,
            fps=reading.fps,
        )

    def say(self, name: str, line: str) -> None:
        """Show a line that the child `name` wrote."""
        self._console.print(f"[{name}] {line}", markup=False, highlight=False)


class Lines:
    """Lines on stderr, plain or logged: every few seconds and whenever the state changes."""

    def __init__(self, logged: bool = False) -> None:
        self._logged = logged
        self._due = 0.0
        self._state = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        return None

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
        text = f"{reading.frames}{of} frames, {reading.fps:.0f}/s, {reading.state}{why}{eta}"
        if self._logged:
            _LOG.info(text)
        else:
            print(text, file=sys.stderr, flush=True)

    def say(self, name: str, line: str) -> None:
        """Show a line that the child `name` wrote."""
        print(line if self._logged else f"[{name}] {line}", file=sys.stderr, flush=True)


class CountLines:
    """Writes counts to stdout for the `odom run` above."""

    def __init__(self, total: int | None) -> None:
        self._total = "-" if total is None else str(total)
        self._due = 0.0
        self.show(0)

    def show(self, done: int) -> None:
        """Write a line, now and then."""
        now = time.monotonic()
        if now >= self._due:
            self._due = now + _COUNT_PERIOD_S
            print(_COUNT, done, self._total, flush=True)


def parse_count(line: str) -> tuple[int, int | None] | None:
    """Return (done, total if known) of a line of `CountLines`, None for any other line."""
    word, *numbers = line.split(" ")
    if word != _COUNT or len(numbers) != 2:
        return None
    try:
        return int(numbers[0]), int(numbers[1]) if numbers[1] != "-" else None
    except ValueError:
        return None
