"""The progress bar of a terminal: a module of its own, since nothing else needs rich, which takes .04 s to import."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from odom.service.display import Display, Reading


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
