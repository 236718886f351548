"""Landmarks found in a frame: chosen among those the predicted pose shows, then their patches aligned."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.images import FrameImages
from odom.frontend.features.patch_warp import at_half_size, homographies
from odom.frontend.features.patches import PATCH_LIMITS, align_patches
from odom.frontend.features.shutter_compensation import seen_in_motion
from odom.frontend.matching.tuning import TUNING
from odom.geometry.arrays import Array, Image, Index, Mask
from odom.geometry.compiled import compiled


def _spread(uv: Array, priority: Array, chance: Array, enough: float, most: int, across: int, cell_px: int) -> Mask:
    """Choose from n points those that are likely to be found, evenly over the image.

    In each square those of highest `priority` (n) come first; each counts by its `chance` (n) to be found, over how
    many are expected to be found in its square already: the greedy maximum of the sum of log(1 + expected) over the
    squares. Up to `most`, and no more than it takes to find `enough`.
    """
    order = np.argsort(-priority, kind="stable")
    gain = _gains(uv, chance, order, across * (int(uv[:, 1].max()) // cell_px + 1), across, cell_px)
    best_first = order[np.argsort(-gain, kind="stable")][:most]
    found = np.cumsum(chance[best_first])
    chosen = np.zeros(len(uv), np.bool_)
    chosen[best_first[: np.searchsorted(found, enough) + 1]] = True
    return chosen


@compiled
def _gains(uv: Array, chance: Array, order: Index, squares: int, across: int, cell_px: int) -> Array:
    """Return what each of n points adds, in `order`: its chance by how many are expected in its square already."""
    expected, gain = np.zeros(squares), np.zeros(len(order))
    for i, k in enumerate(order):
        square = int(uv[k, 1] // cell_px) * across + int(uv[k, 0] // cell_px)
        gain[i] = chance[k] / (1.0 + expected[square])
        expected[square] += chance[k]
    return gain


@dataclass(frozen=True, eq=False)
class LandmarkPatches:
    """Landmarks by row, and how key frame `keyframe` (n) saw each of them first.

    `position` (n x 3, m) is in the map frame. In the key frame they are at `uv` (n x 2 px) on the surface `plane`
    (n x 3: inverse depth and its slope per pixel); `patch_full` and `patch_half` (n x 25 x 25) are the images around
    them, full and half-size.
    """

    position: Array
    keyframe: Index
    uv: Array
    plane: Array
    patch_full: Image
    patch_half: Image


@dataclass(frozen=True, eq=False)
class Candidates:
    """Landmarks that may be looked for: `rows` (n), and `priority` (n) within one part of the image.

    `chance` (n) is how likely each is to be found: no more are looked for than are needed, besides all that are `due`
    (n). `T_camera_keyframe` (K x 4 x 4) is the motion from their `keyframes` (K numbers, ascending), for the warp.
    """

    rows: Index
    priority: Array
    chance: Array
    due: Mask
    keyframes: Index
    T_camera_keyframe: Array

    @classmethod
    def all_of(cls, rows: Index, keyframes: Index, T_camera_keyframe: Array) -> "Candidates":
        """Return landmarks of which every one is to be looked for."""
        nothing, none = np.zeros(len(rows)), np.zeros(len(rows), dtype=np.bool_)
        return cls(rows, nothing, nothing, none, keyframes, T_camera_keyframe)


@dataclass(frozen=True, eq=False)
class LandmarkMatches:
    """n landmarks found in a frame, by their `rows` in the map.

    Sub-pixel positions `uv` (n x 2), their `covariance_uv` (n x 3: uu, uv, vv, px^2 for one grey level of noise), the
    predicted `inverse_depth` (n, 1/m), and the rows of all that were `looked_for`, ascending.
    """

    rows: Index
    uv: Array
    covariance_uv: Array
    inverse_depth: Array
    looked_for: Index

    def take(self, chosen: Index) -> "LandmarkMatches":
        """Return the chosen ones of those found."""
        return LandmarkMatches(
            self.rows.take(chosen),
            self.uv.take(chosen, 0),
            self.covariance_uv.take(chosen, 0),
            self.inverse_depth.take(chosen),
            self.looked_for,
        )

    def missed(self, inliers: Mask) -> Index:
        """Return the rows of those that were looked for and are not among the found ones that are `inliers`."""
        is_missed = np.ones(len(self.looked_for), dtype=np.bool_)
        is_missed[np.searchsorted(self.looked_for, self.rows[inliers])] = False
        return self.looked_for[is_missed]


@dataclass(frozen=True, eq=False)
class _Expected:
    """n landmarks that a pose shows in an image: `rows` in the map, `uv` (n x 2 px), `depth_m` (n).

    `H_reference_current` (n x 3 x 2) warps their patches as far as they are `usable` (n), see `homographies`.
    """

    rows: Index
    uv: Array
    depth_m: Array
    H_reference_current: Array
    usable: Mask

    @classmethod
    def of(
        cls,
        landmarks: LandmarkPatches,
        candidates: Candidates,
        T_camera_map: Array,
        twist: Array,
        sensor: SensorModel,
        most: int,
    ) -> "_Expected":
        """Return up to `most` of the `candidates`, spread over the image of a camera at `T_camera_map`.

        They are where its shutter shows them while it moves with `twist` (6, SI, its own frame).
        """
        lens, cell_px, readout_s = sensor.lens, TUNING.search_cell_px, sensor.timing.readout_s
        rows, priority, chance = candidates.rows, candidates.priority, candidates.chance
        position = landmarks.position.take(rows, 0)
        seen = seen_in_motion(position, T_camera_map, lens, twist, readout_s, TUNING.search_margin_px)
        visible = np.flatnonzero(seen[:, 2] > 0.0)
        rows, seen = rows.take(visible), seen.take(visible, 0)
        priority, chance = priority.take(visible), chance.take(visible)
        if len(rows) > most or chance.sum() > TUNING.search_enough:
            across, enough = lens.rays.shape[1] // cell_px + 1, TUNING.search_enough
            chosen = _spread(seen[:, :2], priority, chance, enough, most, across, cell_px)
            chosen |= candidates.due.take(visible)
            rows, seen = rows[chosen], seen[chosen]
        H, usable = homographies(
            landmarks.uv.take(rows, 0),
            landmarks.plane.take(rows, 0),
            np.searchsorted(candidates.keyframes, landmarks.keyframe.take(rows)),
            candidates.T_camera_keyframe,
            lens,
        )
        return cls(rows, seen[:, :2].copy(), seen[:, 2], H, usable)

    def aligned_finely(
        self, landmarks: LandmarkPatches, image: Image, uv: Array, valid: Mask
    ) -> tuple[NDArray[np.float32], Array]:
        """Align the patches in the full image from `uv`, which changes (see `align_patches`)."""
        iterations, limit_px = TUNING.search_iterations, TUNING.search_fine_limit_px
        patches, H = landmarks.patch_full, self.H_reference_current
        return align_patches(image, patches, self.rows, H, uv, valid, iterations, limit_px, PATCH_LIMITS)

    def aligned_coarsely(self, landmarks: LandmarkPatches, images: FrameImages) -> tuple[Array, Mask]:
        """Return where the half-size image shows them (n x 2 px of the full one), and which were found there."""
        uv = self.uv / 2.0
        iterations, limit_px = TUNING.search_iterations, TUNING.search_coarse_limit_px
        patches, H = landmarks.patch_half, at_half_size(self.H_reference_current)
        score, _ = align_patches(
            images.half, patches, self.rows, H, uv, self.usable, iterations, limit_px, PATCH_LIMITS
        )
        return 2.0 * uv, score > TUNING.search_coarse_score


def find_landmarks(
    landmarks: LandmarkPatches,
    candidates: Candidates,
    T_camera_map: Array,
    twist: Array,
    images: FrameImages,
    sensor: SensorModel,
    most: int,
    is_near: bool = False,
) -> LandmarkMatches:
    """Look for up to `most` of the `candidates` among `landmarks` where `T_camera_map` predicts them.

    The camera moves with `twist` (6, SI, its own frame), by which its shutter shows them elsewhere than at rest.
    `is_near`: within `search_fine_limit_px`, so that the half-size image need not be searched first.
    """
    expected = _Expected.of(landmarks, candidates, T_camera_map, twist, sensor, most)
    rows, uv, valid = expected.rows, expected.uv.copy(), expected.usable
    if not is_near:
        uv, valid = expected.aligned_coarsely(landmarks, images)
    score, covariance = expected.aligned_finely(landmarks, images.full, uv, valid)
    found = np.flatnonzero(score > TUNING.search_fine_score)
    inverse_depth = 1.0 / expected.depth_m.take(found)
    return LandmarkMatches(rows.take(found), uv.take(found, 0), covariance.take(found, 0), inverse_depth, rows)


def find_coarsely(
    landmarks: LandmarkPatches,
    candidates: Candidates,
    T_camera_map: Array,
    twist: Array,
    images: FrameImages,
    sensor: SensorModel,
) -> tuple[Index, Array, Mask]:
    """Look for all `candidates` that `T_camera_map` shows in the half-size image, some eight pixels around.

    The camera moves with `twist` (see `find_landmarks`).
    Returns their rows (n), where they are (n x 2 px of the full image), and which of them were found.
    """
    expected = _Expected.of(landmarks, candidates, T_camera_map, twist, sensor, len(candidates.rows))
    return (expected.rows, *expected.aligned_coarsely(landmarks, images))
