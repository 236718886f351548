"""A yardstick for a frame's cost: the time OpenCV takes to follow corners to the next image on this machine."""

import time

import cv2
import numpy as np

from odom.frontend.features.images import grey_of
from odom.geometry.arrays import Image

CORNERS = 400
"""Corners followed, as many as sparse odometries commonly follow."""

_EVERY = 10
"""Frames from one timing to the next."""


class CornerFollowing:
    """Times the pyramidal tracker of Lucas and Kanade, with OpenCV's defaults, on pairs of successive images.

    Timed between the frames of a run, it has the machine's speed of that run.
    """

    def __init__(self) -> None:
        self._frames = 0
        self._before: Image | None = None
        self._took_ms: list[float] = []

    @property
    def median_ms(self) -> float | None:
        """Median of the times so far; None where no image had a corner."""
        return float(np.median(self._took_ms)) if self._took_ms else None

    def see(self, color: Image) -> None:
        """Take the next image, H x W x 3 RGB or H x W grey; one pair in ten is timed."""
        turn = self._frames % _EVERY
        self._frames += 1
        if turn == 0:
            self._before = grey_of(color)
        elif turn == 1 and self._before is not None:
            corners = cv2.goodFeaturesToTrack(self._before, CORNERS, 0.01, 5.0)
            if corners is not None:
                grey = grey_of(color)
                begun = time.perf_counter()
                cv2.calcOpticalFlowPyrLK(self._before, grey, corners, corners.copy())
                self._took_ms.append(1e3 * (time.perf_counter() - begun))
