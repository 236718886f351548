"""Which image stands for each key frame: the sharpest of those around it."""

from collections.abc import Sequence

import cv2

from odom.frontend.features.images import grey_of
from odom.geometry.arrays import Image

_GAIN = 1.1
"""A neighbour has to be so much sharper. Smaller: noise decides; larger: blurred images stay."""


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
