"""Which image stands for each key frame: the sharpest of those around it, and where its landmarks are there."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frontend.features.images import grey_of
from odom.geometry.arrays import Array, Image, Mask

_GAIN = 1.1
"""A neighbour has to be so much sharper. Smaller: noise decides; larger: blurred images stay."""
_WINDOW_PX, _LEVELS = (21, 21), 3
"""Of the search for landmarks in a neighbour: motion between two frames, with a margin."""
_THERE_AND_BACK_PX = 0.5
"""A landmark that does not come back to where it was within this was not found."""


def sharpness(color: Image) -> float:
    """Return how sharp an image (H x W x 3 or H x W) is: the variance of its Laplacian."""
    return float(cv2.Laplacian(grey_of(color), cv2.CV_16S).var())


def sharpest(keyframes: Sequence[int], values: Sequence[float], neighbours: int) -> list[int]:
    """Return for each of the increasing frame numbers `keyframes` the sharpest frame within `neighbours` of it.

    `values` is the sharpness of every frame. No frame is chosen twice: each belongs to the key frame it is nearest to.
    """
    chosen = []
    for i, keyframe in enumerate(keyframes):
        before = keyframes[i - 1] if i else -len(values)
        after = keyframes[i + 1] if i + 1 < len(keyframes) else 2 * len(values)
        first = max(keyframe - neighbours, (keyframe + before) // 2 + 1, 0)
        last = min(keyframe + neighbours, (keyframe + after) // 2, len(values) - 1)
        best = max(range(first, last + 1), key=lambda k: values[k], default=keyframe)
        chosen.append(best if values[best] > _GAIN * values[keyframe] else keyframe)
    return chosen


def carried(uv: Array, grey: NDArray[np.uint8], grey_other: NDArray[np.uint8]) -> tuple[Array, Mask]:
    """Return where points `uv` (n x 2 px) of one image are in the `other`, and which were found (n): Lucas-Kanade."""
    if not len(uv):
        return uv, np.zeros(0, dtype=np.bool_)
    begin = uv.astype(np.float32).reshape(-1, 1, 2)
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        grey, grey_other, begin, begin.copy(), winSize=_WINDOW_PX, maxLevel=_LEVELS
    )
    back, came, _ = cv2.calcOpticalFlowPyrLK(
        grey_other, grey, there, there.copy(), winSize=_WINDOW_PX, maxLevel=_LEVELS
    )
    apart = np.linalg.norm((back - begin)[:, 0], axis=1)
    is_found = (found[:, 0] == 1) & (came[:, 0] == 1) & (apart < _THERE_AND_BACK_PX)
    return there[:, 0].astype(np.float64), is_found
