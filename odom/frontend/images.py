"""One frame's grey image and its half-size copy, for tracking and for cutting patches."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class FrameImages:
    """`full` (H x W) and `half` (H/2 x W/2) grey images; a pixel (u, v) of `full` is (u/2, v/2) of `half`."""

    full: Image
    half: Image

    @classmethod
    def of(cls, color: Image) -> "FrameImages":
        """Return the images of `color`, H x W x 3 RGB or H x W grey."""
        grey = color if color.ndim == 2 else np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        return cls(grey, np.asarray(cv2.pyrDown(grey), dtype=np.uint8))


def follow(
    previous: Image, current: Image, uv_previous: NDArray[np.float64], uv_guess: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Follow n features from one image to the next by pyramidal Lucas-Kanade, starting at `uv_guess` (n x 2 px).

    Returns the n x 2 positions and which of them were found inside the image. Coarse: it starts the registration.
    """
    if len(uv_previous) == 0:
        return np.zeros((0, 2)), np.zeros(0, dtype=np.bool_)
    found_uv, status, _ = cv2.calcOpticalFlowPyrLK(
        previous,
        current,
        uv_previous.astype(np.float32),
        uv_guess.astype(np.float32),
        winSize=(15, 15),
        maxLevel=3,
        criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 12, 0.03),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    uv = np.asarray(found_uv, dtype=np.float64)
    height, width = current.shape
    inside = (uv > 3).all(axis=1) & (uv[:, 0] < width - 4) & (uv[:, 1] < height - 4)
    return uv, np.asarray(status.ravel() > 0) & inside
