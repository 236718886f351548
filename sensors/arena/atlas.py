"""The colours of all surfaces in one flat array, each with its chain of halved (mip) images."""

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.geometry.arrays import Image

LEVELS = 9
"""Halved images of each texture: a floor of 1,200 texels has 4 in the last; fewer make distant things glitter."""
CAPACITY = 1 << 25
"""Texels that an atlas can hold at first: more need a copy of it all; what is not filled takes no memory."""


class Atlas(NamedTuple):
    """m textures: `texels` packs 8 bit blue, green, red from the high byte down (red lowest).

    `level_offset` (m x LEVELS) is where a level begins in `texels`, `level_size` (m x LEVELS x 2) its width and
    height, at least 2 each; the levels past the smallest repeat it.
    """

    texels: NDArray[np.uint32]
    level_offset: NDArray[np.int64]
    level_size: NDArray[np.int32]


def _sizes(width: int, height: int) -> list[tuple[int, int]]:
    """Return width and height of all levels, the smallest repeated."""
    sizes = [(width, height)]
    while len(sizes) < LEVELS:
        width, height = max(2, width // 2), max(2, height // 2)
        sizes.append((width, height))
    return sizes


def pack(images: Iterable[Image]) -> Atlas:
    """Return the atlas of RGB images (height x width x 3, at least 2 x 2); each is let go before the next is taken."""
    offset: list[list[int]] = []
    size: list[list[tuple[int, int]]] = []
    texels = np.empty(CAPACITY, np.uint32)
    end = 0
    for image in images:
        level_image = image
        sizes = _sizes(image.shape[1], image.shape[0])
        offsets: list[int] = []
        for level, (width, height) in enumerate(sizes):
            if level and sizes[level] == sizes[level - 1]:
                offsets.append(offsets[-1])
                continue
            if level:
                level_image = np.asarray(
                    cv2.resize(level_image, (width, height), interpolation=cv2.INTER_AREA), np.uint8
                )
            count = width * height
            if end + count > texels.size:
                texels.resize(texels.size + max(count, 1 << 21), refcheck=False)
            packed = texels[end : end + count].reshape(height, width)
            packed[:] = level_image[..., 2]
            for channel in (1, 0):
                packed <<= 8
                packed |= level_image[..., channel]
            offsets.append(end)
            end += count
        offset.append(offsets)
        size.append(sizes)
    texels.resize(end, refcheck=False)
    return Atlas(texels, np.array(offset, np.int64), np.array(size, np.int32))
