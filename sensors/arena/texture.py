"""The colours of all surfaces in one flat array, each with its chain of halved (mip) images."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

LEVELS = 9


@dataclass(frozen=True, eq=False)
class Atlas:
    """m textures: `texels` packs 8 bit blue, green, red from the high byte down (red lowest).

    `level_offset` (m x LEVELS) is where a level begins in `texels`, `level_size` (m x LEVELS x 2) its width and
    height, at least 2 each; the levels past the smallest repeat it.
    """

    texels: NDArray[np.uint32]
    level_offset: NDArray[np.int64]
    level_size: NDArray[np.int32]


def pack(images: Sequence[Image]) -> Atlas:
    """Return the atlas of RGB images (height x width x 3, at least 2 x 2), each level averaged from the one below."""
    offset = np.zeros((len(images), LEVELS), np.int64)
    size = np.zeros((len(images), LEVELS, 2), np.int32)
    parts: list[NDArray[np.uint32]] = []
    end = 0
    for i, image in enumerate(images):
        level_image = image
        for level in range(LEVELS):
            height, width = level_image.shape[:2]
            offset[i, level], size[i, level] = end, (width, height)
            if level == 0 or size[i, level].tolist() != size[i, level - 1].tolist():
                red, green, blue = level_image.astype(np.uint32).transpose(2, 0, 1)
                parts.append(np.asarray(red | green << 8 | blue << 16, np.uint32).ravel())
                end += parts[-1].size
            else:
                offset[i, level] = offset[i, level - 1]
            smaller = (max(2, width // 2), max(2, height // 2))
            if smaller != (width, height):
                level_image = np.asarray(cv2.resize(level_image, smaller, interpolation=cv2.INTER_AREA), np.uint8)
    return Atlas(np.concatenate(parts), offset, size)
