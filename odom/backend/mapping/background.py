"""Work in the background: the newest key frames are adjusted, and their places described and recognised."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

from odom.backend.mapping.bundle_adjustment import Bundle
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.backend.mapping.local_adjustment import Adjustment
from odom.backend.mapping.tuning import TUNING
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.place_descriptor import Place
from odom.frontend.matching.place_recognition import Recognition


@dataclass(frozen=True, eq=False)
class DescribedKeyframe:
    """The place that a key frame shows, and the earlier ones that look like it."""

    seen: KeyframeView
    place: Place
    recognitions: list[Recognition]


@dataclass(frozen=True, eq=False)
class _Task:
    due: int
    begun: SteadyStamp
    adjustment: Adjustment
    result: Future[tuple[Bundle, list[DescribedKeyframe]]]


class Background:
    """One task at a time, in a thread; its result is taken at a fixed frame, so that replays are equal.

    That is `delay_frames` later, or the first one after some time: a slow stream has time enough between two frames.
    """

    def __init__(self, delay_frames: int) -> None:
        self._delay_frames = delay_frames
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="odom-background")
        self._task: _Task | None = None

    @property
    def is_busy(self) -> bool:
        """Whether there is a task whose result has not been taken yet."""
        return self._task is not None

    def start(
        self, count: int, stamp: SteadyStamp, adjustment: Adjustment, describe: Callable[[], list[DescribedKeyframe]]
    ) -> None:
        """Begin to run an adjustment, then `describe`; frame `count`, taken at `stamp`, is the newest."""
        work = self._pool.submit(lambda: (adjustment.run(), describe()))
        self._task = _Task(count + self._delay_frames, stamp, adjustment, work)

    def take(self, count: int | None, stamp: SteadyStamp) -> tuple[Adjustment, Bundle, list[DescribedKeyframe]] | None:
        """Return what is due at frame `count` of `stamp` (None: whatever there is), None where nothing is."""
        if self._task is None:
            return None
        is_long_ago = (stamp - self._task.begun) * 1e-9 > TUNING.background_s
        if count is not None and count < self._task.due and not is_long_ago:
            return None
        task, self._task = self._task, None
        return task.adjustment, *task.result.result()
