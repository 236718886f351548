"""A part of what carries the camera, such as a robot's deck, drawn into the lower part of each frame."""

from dataclasses import replace

import cv2
import numpy as np

from odom.frame import RgbdFrame
from odom.geometry.arrays import Mask


def carrier_mask(frame: RgbdFrame, share: float) -> Mask:
    """Return which pixels (H x W) of a frame the carrier covers, a `share` of them."""
    height, width = frame.depth_mm.shape
    return np.arange(height)[:, None] >= round((1.0 - share) * height) + np.zeros(width, int)


def carried(frame: RgbdFrame, share: float, depth_mm: int = 600) -> RgbdFrame:
    """Return a frame before which the carrier stands, full of corners; `depth_mm` 0: nearer than the sensor measures.

    Its pixels have noise of their own in each frame.
    """
    covered = carrier_mask(frame, share)
    rng = np.random.default_rng(frame.sequence)
    height, width = frame.depth_mm.shape
    squares = np.random.default_rng(5).integers(0, 255, (height // 8 + 1, width // 8 + 1), dtype=np.uint8)
    paint = cv2.GaussianBlur(squares.repeat(8, 0).repeat(8, 1), (0, 0), 2)[:height, :width].astype(int)
    color, depth = np.array(frame.color), np.array(frame.depth_mm)
    seen = np.clip(paint[covered] + rng.integers(-4, 5, covered.sum()), 0, 255)
    color[covered] = seen if color.ndim == 2 else seen[:, None]
    depth[covered] = np.rint(rng.normal(depth_mm, 2.0, covered.sum())) if depth_mm else 0
    return replace(frame, color=color, depth_mm=depth)
