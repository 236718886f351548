"""One frame's grey image and its half-size copy: features are followed, searched and cut out in them."""

from dataclasses import dataclass

import cv2
import numpy as np

from odom.geometry.arrays import Image, uniform


def grey_of(color: Image) -> Image:
    """Return a colour image (H x W x 3 RGB) in grey (H x W); a grey one as it is."""
    return color if color.ndim == 2 else np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class FrameImages:
    """`full` (H x W) and `half` (H/2 x W/2) grey images; pixel (u, v) of `full` is (u/2, v/2) of `half`."""

    full: Image
    half: Image

    @classmethod
    def of(cls, color: Image) -> "FrameImages":
        """Return the images of `color`, H x W x 3 RGB or H x W grey."""
        grey = uniform(grey_of(color))
        return cls(grey, uniform(np.asarray(cv2.pyrDown(grey), dtype=np.uint8)))
