"""The covariances that the odometry has published for recent poses and for key frames."""

from collections import OrderedDict

import numpy as np

from odom.evaluation.times import Stamps
from odom.frame import Stamp
from odom.geometry.arrays import Array, Mask

_RECENT = 900
"""Newest poses that are kept in any case, since the path says later which of them were key frames: 30 s at 30 Hz."""


class ClaimedCovariances:
    """6 x 6 covariances (`geometry.se3`, since the segment began) of the newest 900 poses and of those `kept`."""

    def __init__(self) -> None:
        self._recent: OrderedDict[Stamp, Array] = OrderedDict()
        self._kept: dict[Stamp, Array] = {}

    def add(self, stamp: Stamp, covariance: Array) -> None:
        """Remember the covariance of the newest pose."""
        self._recent[stamp] = covariance
        if len(self._recent) > _RECENT:
            self._recent.popitem(last=False)

    def get(self, stamp: Stamp) -> Array | None:
        """Return the covariance of a pose, None where it is not known."""
        found = self._recent.get(stamp)
        return self._kept.get(stamp) if found is None else found

    def keep(self, stamps: Stamps) -> None:
        """Keep those of the poses at these stamps, and forget what is neither recent nor among them."""
        found = ((Stamp(int(stamp)), self.get(Stamp(int(stamp)))) for stamp in stamps)
        self._kept = {stamp: covariance for stamp, covariance in found if covariance is not None}

    def of(self, stamps: Stamps) -> tuple[Array, Mask]:
        """Return m x 6 x 6 covariances at m stamps, and which of them are known and say something.

        The pose that a segment begins with is zero by definition: its covariance, zero too, says nothing.
        """
        found = [self.get(Stamp(int(stamp))) for stamp in stamps]
        covariances = np.array([np.zeros((6, 6)) if c is None else c for c in found]).reshape(-1, 6, 6)
        return covariances, np.asarray(np.linalg.eigvalsh(covariances)[:, 0] > 0.0)
