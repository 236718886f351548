"""The features of a frame that vote for its pose, and how much each of them counts.

Those that crowd in one part of the image share their votes. New landmarks count less than proven ones, and near ones
less than far ones: who walks by hides the scene, and is not hidden by it, and a pixel stands for a surface that grows
with the square of the distance.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from odom.backend.tracking.pose_solver import projected
from odom.backend.tracking.tuning import TUNING
from odom.frontend.features.image_parts import parts_of
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled


@dataclass(frozen=True, eq=False)
class VotingFeatures:
    """n features of a frame: landmarks at `points` (n x 3, m, map frame), seen at `rays` (n x 2) and `uv` (n x 2 px).

    `eye` (3, m, map frame) is roughly the camera's centre. `seen` (n) says in how many frames each landmark was found
    before, `sigma_px` is the rays' sigma, `pixel` the width of a pixel in the rays' unit.
    """

    points: Array
    eye: Array
    rays: Array
    uv: Array
    seen: Index
    sigma_px: float
    pixel: float

    @cached_property
    def votes(self) -> Array:
        """How much each feature counts (n)."""
        if not len(self.uv):
            return np.zeros(0)
        cell = parts_of(self.uv, TUNING.vote_cell_px)
        proven = np.minimum(1.0, (1.0 + self.seen) / TUNING.proven_frames)
        away = np.linalg.norm(self.points - self.eye, axis=1)
        in_order = np.sort(away)
        median = 0.5 * (in_order[(len(away) - 1) // 2] + in_order[len(away) // 2])
        far = np.clip(away / median, 1.0 / TUNING.far_most, TUNING.far_most) ** 2
        return np.asarray(far * proven / np.sqrt(np.bincount(cell)[cell]))

    def off_px(self, T_camera_map: Array, rays: Array | None = None) -> Array:
        """Return how far each feature is from where a pose puts it (n, px); `rays` (n x 2) replace its own."""
        of = self.points, self.rays if rays is None else rays, T_camera_map
        return np.asarray(_ray_errors(*(np.ascontiguousarray(each) for each in of)) / self.pixel)

    def is_contested(self, T_camera_map: Array, outliers: Mask) -> bool:
        """Return whether so many of the features, the `outliers` (n), disagree with a pose that another may be right.

        A small body rich in texture may have most features: it is enough that those clearly off have many votes.
        """
        count = np.count_nonzero(outliers)
        if count < TUNING.contested_least:
            return False
        if count >= TUNING.contested_share * len(outliers):
            return True
        is_off = outliers & (self.off_px(T_camera_map) > TUNING.agrees_px)
        return bool(self.votes[is_off].sum() >= TUNING.contested_votes * self.votes.sum())

    def exact_votes(self, T_camera_map: Array, rays: Array | None = None) -> float:
        """Return the share of the votes of features that lie just where a pose puts them (see `off_px`)."""
        is_exact = self.off_px(T_camera_map, rays) < TUNING.exact_px
        return float(self.votes[is_exact].sum() / self.votes.sum())


def is_exact(fitted: VotingFeatures, T_fitted: Array, rays_predicted: Array, T_predicted: Array) -> bool:
    """Return whether most features lie just where constant velocity puts them, and not where a fit to all does.

    The rays of `fitted` are carried to the middle row by the motion to `T_fitted`, `rays_predicted` (n x 2) by that to
    `T_predicted`. A near thing that starts to move can be explained, roughly, by a camera that shifts and turns.
    """
    if not len(fitted.uv):
        return False
    exact = fitted.exact_votes(T_predicted, rays_predicted)
    return exact > TUNING.exact_share and exact > TUNING.consensus_gain * fitted.exact_votes(T_fitted)


@compiled
def _ray_errors(points: Array, rays: Array, T: Array) -> Array:
    """Return how far the rays of points are from where the pose `T` puts them (n); infinite behind the camera."""
    out = np.empty(points.shape[0])
    for k in range(points.shape[0]):
        x, y, w = projected(T, points, k)
        out[k] = np.hypot(rays[k, 0] - x, rays[k, 1] - y) if w > 0.0 else np.inf
    return out
