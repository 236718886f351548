"""Corners followed through the recording, and their depth: what the geometric checks work on."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera, RgbdFrame
from odom.frontend.camera.rays import undistorted
from odom.frontend.features.images import grey_of
from odom.frontend.matching.optical_flow import follow_there_and_back
from odom.geometry.arrays import Array, Image

_CORNERS, _REFILL_BELOW = 300, 200
"""Corners are looked for until there are so many, whenever fewer are left: more cost time, fewer cost accuracy."""
_APART_PX = 12
"""Distance between corners: closer ones say the same twice, a larger distance leaves too few."""
_FORWARD_BACKWARD_PX = 0.5
"""A corner followed forth and back must return this closely: a smaller bound loses corners, a larger keeps slips."""
_SPREAD = 0.03
"""Largest range of depth around a corner, as a share of it: more lets edges in, less rejects noise far away."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Corners of one frame: their `ids` (n, increasing).

    `rays` (n x 2) are undistorted x/z and y/z by the given calibration; `depth_m` (n) is NaN where depth is missing or
    has an edge.
    """

    ids: NDArray[np.int64]
    rays: Array
    depth_m: Array


def follow(frames: Sequence[RgbdFrame], camera: Camera) -> list[Tracks]:
    """Return the tracks of every frame; a corner keeps its id as long as optical flow finds it again both ways."""
    previous: Image | None = None
    ids, uv, fresh = np.zeros(0, dtype=np.int64), np.zeros((0, 2)), 0
    out = []
    for frame in frames:
        image = grey_of(frame.color)
        if previous is not None and len(uv):
            found, kept = follow_there_and_back(previous, image, uv, uv, _FORWARD_BACKWARD_PX, 1.0)
            ids, uv = ids[kept], found[kept]
        if len(uv) < _REFILL_BELOW:
            added = _corners(image, uv)
            ids = np.concatenate([ids, np.arange(fresh, fresh + len(added))])
            uv, fresh = np.vstack([uv, added]), fresh + len(added)
        out.append(Tracks(ids, undistorted(camera, uv), depth_at(frame.depth_mm, uv)))
        previous = image
    return out


def depth_at(depth_mm: NDArray[np.uint16], uv: Array) -> Array:
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


def _corners(image: Image, uv: Array) -> Array:
    mask = np.full(image.shape, 255, dtype=np.uint8)
    for u, v in uv:
        cv2.circle(mask, (round(float(u)), round(float(v))), _APART_PX, 0, -1)
    found = cv2.goodFeaturesToTrack(image, _CORNERS - len(uv), 0.01, _APART_PX, mask=mask)
    return np.zeros((0, 2)) if found is None else np.asarray(found, dtype=np.float64).reshape(-1, 2)
