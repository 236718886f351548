"""A trajectory that grows for ever in bounded memory."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from odom.frame import Stamp
from odom.geometry.arrays import Array

if TYPE_CHECKING:
    from odom.evaluation import Trajectory

RESTART_NS = 5_000_000_000
"""Stamps that go back by more begin a new run (a recording played again); out of order they are by milliseconds."""
_GAP_NS = 300_000_000
"""Poses further apart are not joined by a line: nine frames were lost, or the markers were hidden."""
_USUAL_STEPS = 3
"""Poses are joined over so many usual steps, too: in a slow stream, or where a trajectory was thinned out."""


class BoundedTrajectory:
    """Stamped poses (4 x 4), at most `limit`: when full, every second one goes and half as many are taken from then on.

    A strip is a stretch without a gap; a line is drawn within strips only. Stamps must increase: a pose that is not
    newer than the last is ignored. The newest pose is always there.
    """

    def __init__(self, limit: int) -> None:
        self._stamps = np.zeros(limit + 1, dtype=np.int64)
        self._T = np.zeros((limit + 1, 4, 4))
        self._strips = np.zeros(limit + 1, dtype=np.int64)
        self._size = 0
        self._stride = 1
        self._count = 0
        self._provisional = False  # the last pose is there only for being the newest
        self._last_steps: tuple[int, ...] = ()

    def __len__(self) -> int:
        return self._size

    @property
    def newest(self) -> Stamp | None:
        """Stamp of the last pose."""
        return Stamp(int(self._stamps[self._size - 1])) if self._size else None

    def add(self, stamp: Stamp, T: Array) -> bool:
        """Append a pose; return whether a new strip begins with it, since there is a gap before it."""
        newest = self.newest
        if newest is not None and stamp <= newest:
            return False
        begins_strip = False
        if newest is not None:
            step, usual = stamp - newest, min(self._last_steps, default=0)
            begins_strip = step > (max(_GAP_NS, _USUAL_STEPS * usual) if usual else RESTART_NS)
            self._last_steps = (*self._last_steps[-1:], step)
        strip = (self._strips[self._size - 1] + begins_strip) if self._size else 0
        if not self._provisional or begins_strip:
            if self._size == len(self._stamps):
                self._thin()
            self._size += 1
        at = self._size - 1
        self._stamps[at], self._T[at], self._strips[at] = stamp, T, strip
        self._count += 1
        self._provisional = self._count % self._stride != 0
        return begins_strip

    def prepend(self, earlier: "Trajectory") -> None:
        """Put what happened before the first pose in front of it, thinned to half the limit.

        A new strip begins behind each gap in it, and where it ends.
        """
        if self._size:
            earlier = earlier.take(earlier.stamps < self._stamps[0])
        else:
            self._last_steps = tuple(np.diff(earlier.stamps[-3:]).tolist())
        strips = _strips_of(earlier.stamps) - len(earlier)
        every = max(1, -(-len(earlier) // (len(self._stamps) // 2)))
        n = len(earlier.stamps[::every])
        while self._size + n > len(self._stamps):
            self._thin()
        size = self._size
        for kept, new in ((self._stamps, earlier.stamps), (self._T, earlier.T_world_body), (self._strips, strips)):
            kept[n : n + size] = kept[:size].copy()
            kept[:n] = new[::every]
        self._size += n

    def poses(self) -> list[tuple[Stamp, Array]]:
        """Return the stamps and poses (4 x 4) kept."""
        return [(Stamp(int(self._stamps[i])), self._T[i].copy()) for i in range(self._size)]

    def trajectory(self) -> "Trajectory":
        """Return the poses kept."""
        from odom.evaluation import Trajectory  # 9 MB, of which the odometry, which keeps trails too, needs nothing

        return Trajectory(self._stamps[: self._size].copy(), self._T[: self._size].copy())

    def strips(self) -> NDArray[np.int64]:
        """Return the number of the strip of each pose of `trajectory`."""
        return self._strips[: self._size].copy()

    def _thin(self) -> None:
        kept = np.unique(np.append(np.arange(0, self._size, 2), self._size - 1))
        for values in (self._stamps, self._T, self._strips):
            values[: len(kept)] = values[kept]
        self._size = len(kept)
        self._stride *= 2


def _strips_of(stamps: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number of each pose's strip, from 0 on: a new one after each gap."""
    steps = np.diff(stamps)
    longest = max(_GAP_NS, _USUAL_STEPS * float(np.median(steps))) if len(steps) else _GAP_NS
    return np.cumsum(np.diff(stamps, prepend=stamps[:1]) > longest)
