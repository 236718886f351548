"""Corners followed through the recording, and their depth: what the geometric checks work on."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.evaluation.diagnosis.image import grey
from odom.frame import Camera, RgbdFrame
from odom.frontend.camera.rays import undistorted
from odom.geometry.arrays import Array, Image, Mask

_CORNERS, _REFILL_BELOW = 300, 200
"""Corners are looked for until there are so many, whenever fewer are left: more cost time, fewer cost accuracy."""
_APART_PX = 12
"""Distance between corners: closer ones say the same twice, a larger distance leaves too few."""
_WINDOW, _LEVELS = (21, 21), 3
"""Window (px) and pyramid levels of the optical flow, OpenCV's defaults: less loses fast motion, more blurs edges."""
_FORWARD_BACKWARD_PX = 0.5
"""A corner followed forth and back must return this closely: a smaller bound loses corners, a larger keeps slips."""
_SPREAD = 0.03
"""Largest range of depth around a corner, as a share of it: more lets edges in, less rejects noise far away."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Corners of one frame: `ids` (n, increasing) and pixels `uv` (n x 2).

    `rays` (n x 2) are undistorted x/z and y/z by the given calibration; `depth_m` (n) is NaN where depth is missing or
    has an edge.
    """

    ids: NDArray[np.int64]
    uv: Array
    rays: Array
    depth_m: Array


def follow(frames: Sequence[RgbdFrame], camera: Camera) -> list[Tracks]:
    """Return the tracks of every frame; a corner keeps its id as long as optical flow finds it again both ways."""
    previous: Image | None = None
    ids, uv, fresh = np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.float32), 0
    out = []
    for frame in frames:
        image = grey(frame)
        if previous is not None and len(uv):
            kept, uv = _track(previous, image, uv)
            ids = ids[kept]
        if len(uv) < _REFILL_BELOW:
            added = _corners(image, uv)
            ids = np.concatenate([ids, np.arange(fresh, fresh + len(added))])
            uv, fresh = np.vstack([uv, added]).astype(np.float32), fresh + len(added)
        out.append(Tracks(ids, uv.astype(np.float64), undistorted(camera, uv), depth_at(frame.depth_mm, uv)))
        previous = image
    return out


def depth_at(depth_mm: NDArray[np.uint16], uv: NDArray[np.floating]) -> Array:
    """Return the median depth (m) of the 5 x 5 pixels around each of n points; NaN where they differ or are missing."""
    height, width = depth_mm.shape
    column, row = np.rint(uv).astype(np.intp).T.reshape(2, -1)
    inside = (column >= 2) & (column < width - 2) & (row >= 2) & (row < height - 2)
    steps = np.arange(-2, 3)
    patch = depth_mm[
        np.clip(row, 2, height - 3)[:, None, None] + steps[:, None],
        np.clip(column, 2, width - 3)[:, None, None] + steps,
    ].reshape(-1, 25)
    low, high = patch.min(axis=1, initial=65535), patch.max(axis=1, initial=0)
    middle = np.median(patch, axis=1) if len(patch) else np.zeros(0)
    good = inside & (low > 0) & (high - low < _SPREAD * middle)
    return np.where(good, middle * 1e-3, np.nan)


def _track(previous: Image, image: Image, uv: NDArray[np.float32]) -> tuple[Mask, NDArray[np.float32]]:
    """Return which corners are found again both ways, and where."""
    there, found, _ = cv2.calcOpticalFlowPyrLK(previous, image, uv, uv.copy(), winSize=_WINDOW, maxLevel=_LEVELS)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(image, previous, there, uv.copy(), winSize=_WINDOW, maxLevel=_LEVELS)
    good = (found.ravel() == 1) & (returned.ravel() == 1)
    good &= np.linalg.norm(back - uv, axis=1) < _FORWARD_BACKWARD_PX
    height, width = image.shape
    good &= ((there > 4) & (there < np.array([width - 5, height - 5]))).all(axis=1)
    return good, np.asarray(there[good], dtype=np.float32)


def _corners(image: Image, uv: NDArray[np.float32]) -> NDArray[np.float32]:
    mask = np.full(image.shape, 255, dtype=np.uint8)
    for u, v in uv:
        cv2.circle(mask, (round(float(u)), round(float(v))), _APART_PX, 0, -1)
    found = cv2.goodFeaturesToTrack(image, _CORNERS - len(uv), 0.01, _APART_PX, mask=mask)
    return np.zeros((0, 2), dtype=np.float32) if found is None else np.asarray(found, dtype=np.float32).reshape(-1, 2)
