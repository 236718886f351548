"""The poses published since the last loss: with each new one, the motions since two of them are published, too."""

from collections import deque

from odom.backend.odometry.tuning import TUNING
from odom.backend.published_pose import PublishedPose
from odom.frame import Stamp

_SECOND_S = 1.0
"""Time of the longer one of the two motions that are published: RPE and NEES are judged by it."""


class RecentlyPublished:
    """The published poses of the last frames, oldest first."""

    def __init__(self) -> None:
        self._newest: deque[PublishedPose] = deque(maxlen=TUNING.recent)

    @property
    def last(self) -> PublishedPose | None:
        """The newest one, None where there is none."""
        return self._newest[-1] if self._newest else None

    def append(self, published: PublishedPose) -> None:
        """Add the newest one; of too many the oldest is dropped."""
        self._newest.append(published)

    def clear(self) -> None:
        """Forget all of them."""
        self._newest.clear()

    def a_second_before(self, stamp: Stamp) -> PublishedPose | None:
        """Return the one nearest to a second before `stamp` that was not predicted, None where none is near.

        Stamps ascend.
        """
        nearest = None
        for earlier in reversed(self._newest):  # few are looked at
            if earlier.is_predicted:
                continue
            if nearest is not None and _from_a_second(earlier, stamp) > _from_a_second(nearest, stamp):
                break
            nearest = earlier
        is_near = nearest is not None and _from_a_second(nearest, stamp) < TUNING.near_a_second_s
        return nearest if is_near else None


def _from_a_second(earlier: PublishedPose, stamp: Stamp) -> float:
    """Return how far from a second the time between a published pose and `stamp` is, in seconds."""
    return abs((stamp - earlier.frame.stamp) * 1e-9 - _SECOND_S)
