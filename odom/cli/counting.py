"""Progress of a command that counts: a bar on a terminal, a line now and then elsewhere, counts for `odom run`."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from odom.service.progress import COUNT_ENVIRONMENT, CountLines

_LINE_PERIOD_S = 5.0


@contextmanager
def counting(what: str, total: int | None, unit: str = "frames") -> Iterator[Callable[[int], None]]:
    """Give a function that is told how many are done so far; shown on stderr."""
    if os.environ.get(COUNT_ENVIRONMENT) == "1":
        yield CountLines(total).show
        return
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TextColumn(unit), TimeRemainingColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(what, total=total)
            yield lambda done: bar.update(task, completed=done)
        return

    shown = began = time.monotonic()

    def show(done: int) -> None:
        nonlocal shown
        now = time.monotonic()
        if now - shown >= _LINE_PERIOD_S:
            shown = now
            of = "" if total is None else f" of {total}"
            print(f"{what}: {done}{of} {unit}, {done / (now - began):.1f}/s", file=sys.stderr, flush=True)

    yield show
