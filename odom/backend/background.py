"""Beside the frames' path: the newest key frames are adjusted, and places recognised that they show."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.backend.bundle import Bundle
from odom.backend.closing import Recognition
from odom.backend.window import Adjustment
from odom.frontend.places import Place
from odom.frontend.view import View

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Seen:
    """A key frame's own view, kept while it is worked on, and the `twist` (6, SI) it was measured with."""

    keyframe: int
    view: View
    twist: Array


@dataclass(frozen=True, eq=False)
class Described:
    """The place that a key frame shows, and the earlier ones that look like it."""

    seen: Seen
    place: Place
    recognitions: list[Recognition]


@dataclass(frozen=True, eq=False)
class _Task:
    due: int
    adjustment: Adjustment
    result: Future[tuple[Bundle, list[Described]]]


class Background:
    """One task at a time, in a thread; its result is taken at a fixed frame number, so that repeats are equal."""

    def __init__(self, delay_frames: int) -> None:
        self._delay_frames = delay_frames
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="odom-background")
        self._task: _Task | None = None

    @property
    def is_busy(self) -> bool:
        """Whether there is a task whose result was not taken yet."""
        return self._task is not None

    def start(self, count: int, adjustment: Adjustment, describe: Callable[[], list[Described]]) -> None:
        """Begin to run an adjustment, then `describe`; frame `count` is the newest."""
        work = self._pool.submit(lambda: (adjustment.run(), describe()))
        self._task = _Task(count + self._delay_frames, adjustment, work)

    def take(self, count: int | None) -> tuple[Adjustment, Bundle, list[Described]] | None:
        """Return what is due at frame `count` (None: whatever there is), None where nothing is."""
        if self._task is None or (count is not None and count < self._task.due):
            return None
        task, self._task = self._task, None
        return task.adjustment, *task.result.result()
