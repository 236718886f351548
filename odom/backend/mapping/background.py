"""Work in the background, whose results take effect at fixed frames, so that replays are equal."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Generic, TypeVar

from odom.frontend.camera.stamp_clock import SteadyStamp

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class _Task(Generic[Result]):
    due: int
    due_stamp: SteadyStamp
    result: Future[Result]


class Background(Generic[Result]):
    """One task at a time, in a thread of its own."""

    def __init__(self, name: str) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=f"odom-{name}")
        self._task: _Task[Result] | None = None

    @property
    def is_busy(self) -> bool:
        """Whether there is a task whose result has not been taken yet."""
        return self._task is not None

    def start(self, due: int, due_stamp: SteadyStamp, work: Callable[[], Result]) -> None:
        """Begin to work; the result is due at frame number `due`, or at the first one from `due_stamp` on.

        A slow stream has time enough between two frames.
        """
        self._task = _Task(due, due_stamp, self._pool.submit(work))

    def take(self, count: int | None, stamp: SteadyStamp) -> Result | None:
        """Wait for the result and return it if it is due at frame `count` of `stamp` (None: at once), else None."""
        if self._task is None or (count is not None and count < self._task.due and stamp < self._task.due_stamp):
            return None
        task, self._task = self._task, None
        return task.result.result()
