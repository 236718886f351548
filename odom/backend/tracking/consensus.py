"""The pose that most of an image agrees with, where its features follow several motions: the scene's and passers-by's.

Random triples of features each give a pose, which the others then refine (M. Fischler, R. Bolles, CACM 24, 1981;
O. Chum et al., DAGM 2003). Features vote for the poses they agree with; those that crowd in one part of the image
share their votes. New landmarks count less than proven ones, and near ones less than far ones: who walks by hides the
scene, and is not hidden by it. Poses that would be a jerk count less, too.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.backend.tracking.pose_solver import projection_terms
from odom.backend.tracking.tuning import TUNING
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled

_TRIPLE_STEPS, _WIDE_STEPS, _NARROW_STEPS = 4, 2, 1
"""Gauss-Newton steps from a triple alone, and then from all features, less and less tolerant."""
_WIDE = 2.0
"""How much more tolerant the first steps from all features are."""
_WORTH_REFINING = 0.6
"""A triple's pose with this share of the most votes so far is refined."""
_PRIOR = 1e-6
"""Information that keeps a triple in one line from running away."""
_LARGEST_STEP = 1.0
"""A step (m, rad) beyond this leads nowhere."""
_NEAREST_M = 0.05
"""Nearer points are behind the camera, or as good as that."""
_TERMS = 8
"""Of the exponential's series: its steps are below 1."""
_KEY = np.array([1.0, 1000.0])
"""Makes one number of a cell's column and row."""


@dataclass(frozen=True, eq=False)
class ExpectedPose:
    """Where a frame's pose `T_camera_map` is expected, and how far a jerk may take it away: `free` (m, rad)."""

    T_camera_map: Array
    free: Array

    @classmethod
    def after(cls, T_camera_map: Array, since_s: float) -> "ExpectedPose":
        """Return the pose predicted by constant velocity over `since_s` seconds."""
        return cls(T_camera_map, np.array([TUNING.jerk_m_s2, TUNING.jerk_rad_s2]) * since_s**2)

    @classmethod
    def at_unknown_velocity(cls, T_camera_map: Array, since_s: float) -> "ExpectedPose":
        """Return the expectation of a camera that was at a pose `since_s` seconds ago, and moves nobody knows how."""
        return cls(T_camera_map, np.array([TUNING.velocity_sigma_m_s, TUNING.velocity_sigma_rad_s]) * since_s)


@dataclass(frozen=True, eq=False)
class FollowedFeatures:
    """n features of a frame: landmarks at `points` (n x 3, m, map frame), seen at `rays` (n x 2) and `uv` (n x 2 px).

    `eye` (3, m, map frame) is about where from. `seen` (n) says in how many frames each landmark was found before,
    `sigma_px` how exact the rays are, `pixel` how wide a pixel is as a ray.
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
        _, inverse, count = np.unique(self.uv // TUNING.vote_cell_px @ _KEY, return_inverse=True, return_counts=True)
        proven = np.minimum(1.0, (1.0 + self.seen) / TUNING.proven_frames)
        away = np.linalg.norm(self.points - self.eye, axis=1)
        far = np.clip(away / np.median(away), 1.0 / TUNING.far_most, TUNING.far_most)
        return np.asarray(far * proven / np.sqrt(count[inverse]))

    def off_px(self, T_camera_map: Array) -> Array:
        """Return how far each feature is from where a pose puts it (n, px)."""
        points = se3.apply(T_camera_map, self.points)
        return np.asarray(np.linalg.norm(points[:, :2] / points[:, 2:] - self.rays, axis=1) / self.pixel)

    def exact_votes(self, T_camera_map: Array) -> float:
        """Return the share of the votes of features that lie just where a pose puts them."""
        is_exact = self.off_px(T_camera_map) < TUNING.exact_px
        return float(self.votes[is_exact].sum() / self.votes.sum())


def is_contested(outliers: Mask, found: Mask) -> bool:
    """Return whether so many of the features `found` (n) disagree with a pose that another one may be right."""
    most = max(TUNING.contested_least, TUNING.contested_share * np.count_nonzero(found))
    return bool(np.count_nonzero(outliers) >= most)


def is_exact(features: FollowedFeatures, T_predicted: Array, T_fitted: Array) -> bool:
    """Return whether most features lie just where constant velocity puts them, and not where a fit to all does.

    A near thing that starts to move can be explained, roughly, by a camera that shifts and turns against it.
    """
    if not len(features.uv):
        return False
    exact = features.exact_votes(T_predicted)
    return exact > max(TUNING.exact_share, TUNING.consensus_gain * features.exact_votes(T_fitted))


def consensus(features: FollowedFeatures, T_camera_map: Array, expected: ExpectedPose) -> Array | None:
    """Return the pose that clearly more of the features agree with than with `T_camera_map`; None without any."""
    votes = features.votes
    triples = np.random.default_rng(0).choice(len(votes), (TUNING.triples, 3), p=votes / votes.sum())
    T_expected_inverse = se3.inverse(expected.T_camera_map)
    T, gain = _best_pose(
        np.ascontiguousarray(features.points),
        np.ascontiguousarray(features.rays),
        votes,
        features.sigma_px * features.pixel,
        np.ascontiguousarray(T_camera_map),
        triples,
        T_expected_inverse,
        expected.free,
    )
    off_px, off_px_before = features.off_px(T), features.off_px(T_camera_map)
    won = np.count_nonzero((off_px < TUNING.agrees_px) & (off_px_before > TUNING.differs_px))
    return se3.orthonormal(T) if gain > TUNING.consensus_gain and won >= TUNING.contested_least else None


def warm_up() -> None:
    """Compile what `consensus` needs, or load it: in a still scene it is not called before the first passer-by."""
    points = np.random.default_rng(0).uniform((-1.0, -1.0, 2.0), (1.0, 1.0, 4.0), (9, 3))
    rays = points[:, :2] / points[:, 2:]
    features = FollowedFeatures(points, np.zeros(3), rays, points[:, :2], np.ones(9, np.int64), 1.0, 1e-3)
    consensus(features, np.eye(4), ExpectedPose.at_unknown_velocity(np.eye(4), 1.0))


@compiled
def _agreement(
    points: Array, rays: Array, votes: Array, sigma: float, T: Array, T_expected_inverse: Array, free: Array
) -> float:
    """Return the votes for the pose `T`, less where that is a surprise."""
    total = 0.0
    for k in range(points.shape[0]):
        p = points[k]
        X = T[0, 0] * p[0] + T[0, 1] * p[1] + T[0, 2] * p[2] + T[0, 3]
        Y = T[1, 0] * p[0] + T[1, 1] * p[1] + T[1, 2] * p[2] + T[1, 3]
        Z = T[2, 0] * p[0] + T[2, 1] * p[1] + T[2, 2] * p[2] + T[2, 3]
        if Z > _NEAREST_M:
            x, y = rays[k, 0] - X / Z, rays[k, 1] - Y / Z
            total += votes[k] / (1.0 + (x * x + y * y) / sigma**2)
    D = T @ T_expected_inverse
    away_m2 = D[0, 3] ** 2 + D[1, 3] ** 2 + D[2, 3] ** 2
    away_rad2 = 0.25 * ((D[2, 1] - D[1, 2]) ** 2 + (D[0, 2] - D[2, 0]) ** 2 + (D[1, 0] - D[0, 1]) ** 2)
    surprise = away_m2 / free[0] ** 2 + away_rad2 / free[1] ** 2
    return float(total / max(1.0, surprise))


@compiled
def _moved(x: NDArray[np.floating[Any]], T: Array) -> Array:
    """Return exp(x) @ T by the exponential's series."""
    A = np.zeros((4, 4))
    A[0, 1], A[0, 2], A[1, 0], A[1, 2], A[2, 0], A[2, 1] = -x[5], x[4], x[5], -x[3], -x[4], x[3]
    A[0, 3], A[1, 3], A[2, 3] = x[0], x[1], x[2]
    term, E = np.eye(4), np.eye(4)
    for n in range(1, _TERMS):
        term = term @ A / n
        E = E + term
    return E @ T


@compiled
def _refined(
    points: Array, rays: Array, votes: Array, sigma: float, T_start: Array, members: Index, steps: int
) -> tuple[Array, bool]:
    """Return the pose of the features `members`, robustly unless `sigma` is infinite; False where it runs away."""
    T = T_start
    J, P, r, value = np.zeros((3, 6)), np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    for _ in range(steps):
        H = _PRIOR * np.eye(6)
        g = np.zeros(6)
        for k in members:
            value[0], value[1] = rays[k, 0], rays[k, 1]
            if not projection_terms(T, points[k], value, J, P, r):
                continue
            weight = votes[k] / (1.0 + (r[0] * r[0] + r[1] * r[1]) / sigma**2) ** 2
            for a in range(6):
                g[a] += weight * (J[0, a] * r[0] + J[1, a] * r[1])
                for b in range(6):
                    H[a, b] += weight * (J[0, a] * J[0, b] + J[1, a] * J[1, b])
        x = np.linalg.solve(H, g)
        if not np.abs(x).max() < _LARGEST_STEP:
            return T, False
        T = _moved(x, T)
    return T, True


@compiled
def _best_pose(
    points: Array,
    rays: Array,
    votes: Array,
    sigma: float,
    T_start: Array,
    triples: Index,
    T_expected_inverse: Array,
    free: Array,
) -> tuple[Array, float]:
    """Return the pose with the most votes that a triple leads to, and how many times as many `T_start` has."""
    best = T_start
    first = _agreement(points, rays, votes, sigma, T_start, T_expected_inverse, free)
    most = first
    everything = np.arange(points.shape[0])
    for s in range(triples.shape[0]):
        T, good = _refined(points, rays, votes, np.inf, T_start, triples[s], _TRIPLE_STEPS)
        if not good:
            continue
        if _agreement(points, rays, votes, sigma, T, T_expected_inverse, free) < _WORTH_REFINING * most:
            continue
        T, good = _refined(points, rays, votes, _WIDE * sigma, T, everything, _WIDE_STEPS)
        if not good:
            continue
        T, good = _refined(points, rays, votes, sigma, T, everything, _NARROW_STEPS)
        agreed = _agreement(points, rays, votes, sigma, T, T_expected_inverse, free)
        if good and agreed > most:
            best, most = T, agreed
    return best, most / first if first > 0.0 else np.inf
