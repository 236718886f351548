"""Features of one frame found again in the next, with whole-pixel accuracy: the start of a frame's registration."""

import math

import cv2
import numpy as np

from odom.frontend.matching.tuning import TUNING
from odom.geometry.arrays import Array, Image, Mask

_BORDER_PX = 3
"""Closer to the border OpenCV's search window is mostly outside the image."""
_EPSILON_PX = 0.03
"""Steps smaller than this end the search: far below what a coarse position needs."""


def follow_features(
    previous: Image, current: Image, uv_previous: Array, uv_guess: Array, scale: float
) -> tuple[Array, Mask]:
    """Follow n features from one grey image to the next by pyramidal Lucas-Kanade, starting at `uv_guess` (n x 2 px).

    Images that were enlarged by `scale` (see `FrameImages`) have one more level for each doubling.
    Returns their positions (n x 2 px) and which of them were found inside the image (n). Source: J.-Y. Bouguet,
    "Pyramidal implementation of the Lucas Kanade feature tracker", 2001.
    """
    if len(uv_previous) == 0:
        return np.zeros((0, 2)), np.zeros(0, dtype=np.bool_)
    found_uv, status, _ = cv2.calcOpticalFlowPyrLK(
        previous,
        current,
        uv_previous.astype(np.float32),
        uv_guess.astype(np.float32),
        winSize=(TUNING.flow_window_px, TUNING.flow_window_px),
        maxLevel=TUNING.flow_levels + max(0, round(math.log2(scale))),
        criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, TUNING.flow_iterations, _EPSILON_PX),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    uv = np.asarray(found_uv, dtype=np.float64)
    height, width = current.shape
    inside = (uv > _BORDER_PX).all(axis=1) & (uv[:, 0] < width - 4) & (uv[:, 1] < height - 4)
    return uv, np.asarray(status.ravel() > 0) & inside


def follow_there_and_back(
    previous: Image, current: Image, uv_previous: Array, uv_guess: Array, within_px: float, scale: float
) -> tuple[Array, Mask]:
    """Follow n features as `follow_features` does; found are those that lead back to less than `within_px` px away."""
    uv, found = follow_features(previous, current, uv_previous, uv_guess, scale)
    followed = np.flatnonzero(found)
    uv_back, is_back = follow_features(current, previous, uv[followed], uv_previous[followed], scale)
    found[followed] = is_back & (np.linalg.norm(uv_back - uv_previous[followed], axis=1) < within_px)
    return uv, found
