"""Selects the depth pixels that show a surface: near enough to be exact, and not at edges where depths are mixed."""

import cv2
import numpy as np
from numpy.typing import NDArray

_STEP = 0.05
"""Share of the depth by which a pixel may differ from its neighbours. Smaller: slanted floors go; larger: points float
in the air behind edges, where a sensor mixes near and far."""


def surface_depth(depth_mm: NDArray[np.uint16], farthest_m: float) -> NDArray[np.uint16]:
    """Return the depth image (H x W, mm) with 0 for what is farther than that or lies at a step of depth."""
    near = np.where((depth_mm > 0) & (depth_mm <= 1e3 * farthest_m), depth_mm, 0).astype(np.uint16)
    kernel = np.ones((3, 3), np.uint8)
    lowest = cv2.erode(np.where(near > 0, near, np.uint16(65535)), kernel)
    is_step = cv2.dilate(near, kernel) - lowest.astype(np.int32) > _STEP * near
    return np.where(is_step, 0, near).astype(np.uint16)
