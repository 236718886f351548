"""One colour image and the depth image that belongs to it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.frame.stamp import Stamp


@dataclass(frozen=True, eq=False)
class RgbdFrame:
    """A colour image and the nearest depth image, each with its own capture stamp.

    `color` is H x W x 3 uint8 RGB or H x W uint8 grey; `depth_mm` is H x W uint16 millimetres along the optical
    axis, registered to colour, 0 where nothing was measured (REP-118). The frame's pose is the colour camera's
    optical frame (REP-103: x right, y down, z forward) at `stamp`, the colour image's.
    Raises InputError when shapes or types disagree.
    """

    sequence: int
    stamp: Stamp
    color: NDArray[np.uint8]
    depth_stamp: Stamp
    depth_mm: NDArray[np.uint16]

    def __post_init__(self) -> None:
        if self.color.dtype != np.uint8 or self.color.ndim not in (2, 3):
            raise InputError(f"colour is {self.color.dtype} of shape {self.color.shape}: give uint8, H x W (x 3)")
        if self.depth_mm.dtype != np.uint16 or self.depth_mm.shape != self.color.shape[:2]:
            raise InputError(
                f"depth is {self.depth_mm.dtype} of shape {self.depth_mm.shape}: give uint16 of {self.color.shape[:2]}"
            )
