"""Landmarks found in a frame: chosen among those the predicted pose shows, then their patches aligned."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from odom.frontend.camera.lens import project
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.images import FrameImages
from odom.frontend.features.patch_warp import WARP_LIMITS, affinities
from odom.frontend.features.patches import PATCH_LIMITS, align_patches
from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Array, Image, Index, Mask
from odom.geometry.compiled import compiled


@compiled
def _spread(uv: Array, priority: Array, most: int, across: int, cell_px: int) -> Mask:
    """Choose up to `most` of n points evenly over the image: the best of each square, then the second best, ..."""
    n = uv.shape[0]
    order = np.argsort(-priority, kind="mergesort")
    count = np.zeros(across * (int(uv[:, 1].max()) // cell_px + 1), np.int64)
    rank = np.zeros(n, np.int64)
    for k in order:
        square = int(uv[k, 1] // cell_px) * across + int(uv[k, 0] // cell_px)
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


class LandmarkPatches(Protocol):
    """Landmarks by row, and how key frame `keyframe` saw them."""

    @property
    def position(self) -> Array:
        """Where they are (n x 3, m, map frame)."""

    @property
    def keyframe(self) -> Index:
        """The key frame that saw each of them first (n)."""

    @property
    def uv(self) -> Array:
        """Where they were seen there (n x 2 px)."""

    @property
    def plane(self) -> Array:
        """The surface they lie on there (n x 3): inverse depth and its slope per pixel."""

    @property
    def patch_full(self) -> Image:
        """The patches around them (n x 25 x 25)."""

    @property
    def patch_half(self) -> Image:
        """The patches around them in the half-size image (n x 25 x 25)."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Landmarks that may be looked for: `rows` (n), and `priority` (n) within one part of the image.

    `T_camera_keyframe` (K x 4 x 4) is the motion from their `keyframes` (K numbers, ascending), for the warp.
    """

    rows: Index
    priority: Array
    keyframes: Index
    T_camera_keyframe: Array


@dataclass(frozen=True, eq=False)
class Found:
    """n landmarks found in a frame, by their `rows` in the map.

    Sub-pixel positions `uv` (n x 2), their `covariance_uv` (n x 3: uu, uv, vv, px^2 for one grey level of noise), the
    predicted `inverse_depth` (n, 1/m), and the rows of all that were `looked_for`.
    """

    rows: Index
    uv: Array
    covariance_uv: Array
    inverse_depth: Array
    looked_for: Index

    def take(self, chosen: Mask) -> "Found":
        """Return the chosen ones of those found."""
        return replace(
            self,
            rows=self.rows[chosen],
            uv=self.uv[chosen],
            covariance_uv=self.covariance_uv[chosen],
            inverse_depth=self.inverse_depth[chosen],
        )


def find_landmarks(
    landmarks: LandmarkPatches,
    candidates: Candidates,
    T_camera_map: Array,
    images: FrameImages,
    sensor: SensorModel,
    most: int,
    is_near: bool = False,
) -> Found:
    """Look for up to `most` of the `candidates` among `landmarks` where `T_camera_map` predicts them.

    `is_near`: within `search_fine_limit_px`, so that the half-size image need not be searched first.
    """
    lens, cell_px, margin_px = sensor.lens, TUNING.search_cell_px, TUNING.search_margin_px
    rows, priority = candidates.rows, candidates.priority
    height, width = images.full.shape
    seen = project(landmarks.position[rows], T_camera_map, lens.intrinsics, lens.distortion, width, height, margin_px)
    visible = np.isfinite(seen[:, 0])
    rows, seen, priority = rows[visible], seen[visible], priority[visible]
    if len(rows) > most:
        chosen = _spread(seen[:, :2], priority, most, width // cell_px + 1, cell_px)
        rows, seen = rows[chosen], seen[chosen]
    A, usable = affinities(
        landmarks.uv[rows],
        landmarks.plane[rows],
        np.searchsorted(candidates.keyframes, landmarks.keyframe[rows]),
        candidates.T_camera_keyframe,
        lens.rays,
        lens.intrinsics,
        lens.distortion,
        WARP_LIMITS,
    )
    patches_full = landmarks.patch_full[rows]
    iterations = TUNING.search_iterations
    uv = seen[:, :2].copy()
    if not is_near:
        uv /= 2.0
        patches_half = landmarks.patch_half[rows]
        limit_px = TUNING.search_coarse_limit_px
        score, _ = align_patches(images.half, patches_half, A, uv, usable, iterations, limit_px, PATCH_LIMITS)
        usable &= score > TUNING.search_coarse_score
        uv *= 2.0
    limit_px = TUNING.search_fine_limit_px
    score, covariance = align_patches(images.full, patches_full, A, uv, usable, iterations, limit_px, PATCH_LIMITS)
    found = score > TUNING.search_fine_score
    return Found(rows[found], uv[found], covariance[found], 1.0 / seen[found, 2], rows)
