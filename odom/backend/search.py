"""Which landmarks to look for in a frame, and finding them there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.backend.landmarks import Landmarks
from odom.frame import Camera
from odom.frontend.images import FrameImages
from odom.frontend.lens import Lens, project
from odom.frontend.patches import align_patches
from odom.frontend.warp import affinities
from odom.registration.compiled import compiled

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_MARGIN_PX = 8.0
_CELL_PX = 40
_COARSE_LIMIT_PX, _COARSE_SCORE = 4.0, 0.6
_FINE_LIMIT_PX, _FINE_SCORE = 2.5, 0.75
_ITERATIONS = 8


@compiled
def _spread(uv: Array, priority: Array, most: int, across: int) -> NDArray[np.bool_]:
    """Choose up to `most` of n points evenly over the image: the best of each square, then the second best, ..."""
    n = uv.shape[0]
    order = np.argsort(-priority, kind="mergesort")
    count = np.zeros(across * (int(uv[:, 1].max()) // _CELL_PX + 1), np.int64)
    rank = np.zeros(n, np.int64)
    for k in order:
        square = int(uv[k, 1] // _CELL_PX) * across + int(uv[k, 0] // _CELL_PX)
        rank[k] = count[square]
        count[square] += 1
    chosen = np.zeros(n, np.bool_)
    taken = 0
    for depth in range(n):
        for k in order:
            if rank[k] == depth:
                chosen[k] = True
                taken += 1
                if taken == most:
                    return chosen
    return chosen


@dataclass(frozen=True, eq=False)
class Found:
    """Landmarks found in a frame.

    `rows` of the landmarks, sub-pixel positions `uv` (n x 2), `covariance_uv` (n x 3: uu, uv, vv, px^2 for one grey
    level of noise), the predicted `inverse_depth` (n, 1/m), and the rows of all that were `looked_for`.
    """

    rows: Index
    uv: Array
    covariance_uv: Array
    inverse_depth: Array
    looked_for: Index


def look_for(
    landmarks: Landmarks,
    candidates: Index,
    priority: Array,
    T_camera_map: Array,
    keyframes: Index,
    T_camera_keyframe: Array,
    images: FrameImages,
    camera: Camera,
    lens: Lens,
    most: int,
) -> Found:
    """Look for up to `most` of the `candidates` (rows of `landmarks`) where `T_camera_map` predicts them.

    `priority` (n) ranks candidates of one part of the image; `T_camera_keyframe` (K x 4 x 4) gives the motion from the
    candidates' `keyframes` (K numbers, ascending), for the warp of their patches.
    """
    seen = project(
        landmarks.position[candidates],
        T_camera_map,
        lens.intrinsics,
        lens.distortion,
        camera.width,
        camera.height,
        _MARGIN_PX,
    )
    visible = np.isfinite(seen[:, 0])
    rows, seen, priority = candidates[visible], seen[visible], priority[visible]
    if len(rows) > most:
        chosen = _spread(seen[:, :2], priority, most, camera.width // _CELL_PX + 1)
        rows, seen = rows[chosen], seen[chosen]
    A, usable = affinities(
        landmarks.uv[rows],
        landmarks.plane[rows],
        np.searchsorted(keyframes, landmarks.keyframe[rows]),
        T_camera_keyframe,
        lens.rays,
        lens.intrinsics,
        lens.distortion,
    )
    uv = seen[:, :2] / 2.0
    score, _ = align_patches(images.half, landmarks.patch_half[rows], A, uv, usable, _ITERATIONS, _COARSE_LIMIT_PX)
    usable &= score > _COARSE_SCORE
    uv *= 2.0
    score, covariance = align_patches(
        images.full, landmarks.patch_full[rows], A, uv, usable, _ITERATIONS, _FINE_LIMIT_PX
    )
    found = score > _FINE_SCORE
    return Found(rows[found], uv[found], covariance[found], 1.0 / seen[found, 2], rows)
