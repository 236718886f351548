"""Camera motion between frames from corners with depth on both sides, and the focal lengths that fit it best.

A rigid motion must explain at once how corners move in the image and how their depths change. A focal length that is
wrong bends the back-projected points, and no rigid motion explains both once the camera has turned; so the ratio of
the given to the true focal lengths, `exp(a)`, is solved for together with the motions of many pairs of frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.evaluation.alignment import align
from odom.evaluation.diagnosis.tracks import Tracks
from odom.registration import se3

Array = NDArray[np.float64]

_PIXEL_SIGMA = 0.7
_DEPTH_SIGMA_AT_1M = 0.003
_CAUCHY = 9.0
_LEAST_POINTS = 25
_FARTHEST_M = 4.0
_PAIR_ITERATIONS = 12
_FOCAL_ITERATIONS = 8


@dataclass(frozen=True, eq=False)
class PairMotion:
    """Motion of the camera between two frames: `T_later_earlier` maps points.

    `rays_*` (n x 2) and `depth_*` (n, m) are the corners seen in both; `inliers` is the share of them that fits,
    `seconds` lie between the frames.
    """

    earlier: int
    later: int
    T_later_earlier: Array
    rays_earlier: Array
    depth_earlier: Array
    rays_later: Array
    depth_later: Array
    inliers: float
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class FocalFit:
    """Given over fitted focal lengths, x and y, and the standard deviations of their logarithms."""

    ratio: Array
    sigma: Array
    pairs: int


def pair_motion(tracks: Sequence[Tracks], earlier: int, later: int, focal_px: Array) -> PairMotion | None:
    """Return the motion between two frames, None when too few corners with depth join them."""
    a, b = tracks[earlier], tracks[later]
    _, in_a, in_b = np.intersect1d(a.ids, b.ids, assume_unique=True, return_indices=True)
    z_a, z_b = a.depth_m[in_a], b.depth_m[in_b]
    good = np.isfinite(z_a) & np.isfinite(z_b) & (z_a < _FARTHEST_M) & (z_b < _FARTHEST_M)
    if good.sum() < _LEAST_POINTS:
        return None
    rays_a, rays_b, z_a, z_b = a.rays[in_a][good], b.rays[in_b][good], z_a[good], z_b[good]
    start = _robust_start(_points(rays_a, z_a), _points(rays_b, z_b))
    motion = PairMotion(earlier, later, start, rays_a, z_a, rays_b, z_b, 0.0)
    T = start
    for _ in range(_PAIR_ITERATIONS):
        H, g, _, _, weights = _normal_equations(motion, T, np.zeros(2), focal_px)
        step = np.linalg.solve(H + 1e-9 * np.trace(H) * np.eye(6), g)
        T = se3.exp(step) @ T
        if np.abs(step).max() < 1e-7:
            break
    inliers = float((weights > 0.4).mean())
    return PairMotion(earlier, later, T, rays_a, z_a, rays_b, z_b, inliers) if inliers > 0.4 else None


def fit_focal(motions: Sequence[PairMotion], focal_px: Array) -> FocalFit | None:
    """Return the focal lengths that let rigid motions explain all pairs best, None for fewer than eight pairs."""
    if len(motions) < 8:
        return None
    a = np.zeros(2)
    T = [motion.T_later_earlier for motion in motions]
    for _ in range(_FOCAL_ITERATIONS):
        information, gradients, steps = [], [], []
        for motion, T_k in zip(motions, T, strict=True):
            H, g, cross, (H_a, g_a), _ = _normal_equations(motion, T_k, a, focal_px)
            solved = np.linalg.solve(H + 1e-9 * np.trace(H) * np.eye(6), np.column_stack([cross, g]))
            information.append(H_a - cross.T @ solved[:, :2])
            gradients.append(g_a - cross.T @ solved[:, 2])
            steps.append(solved)
        step = np.linalg.solve(np.sum(information, axis=0) + 1e-3 * np.eye(2), np.sum(gradients, axis=0))
        step = np.clip(step, -0.15, 0.15)
        a = a + step
        T = [se3.exp(s[:, 2] - s[:, :2] @ step) @ T_k for s, T_k in zip(steps, T, strict=True)]
    bread = np.linalg.inv(np.sum(information, axis=0) + 1e-3 * np.eye(2))
    groups = np.array_split(np.arange(len(motions)), min(10, len(motions)))
    scores = np.array([np.sum([gradients[i] for i in group], axis=0) for group in groups])
    meat = scores.T @ scores * len(groups) / (len(groups) - 1)
    sigma = np.sqrt(np.maximum(np.diag(bread), np.diag(bread @ meat @ bread)))
    return FocalFit(np.exp(a), sigma, len(motions))


def _points(rays: Array, depth_m: Array) -> Array:
    return np.column_stack([rays * depth_m[:, None], depth_m])


def _robust_start(points_earlier: Array, points_later: Array) -> Array:
    keep = np.ones(len(points_earlier), dtype=bool)
    for _ in range(6):
        T = align(points_earlier[keep], points_later[keep]).T_truth_estimate
        error = np.linalg.norm(se3.apply(T, points_earlier) - points_later, axis=1) / points_later[:, 2]
        keep = error <= max(2.5 * float(np.median(error)), 0.004)
    return T


def _normal_equations(
    motion: PairMotion, T: Array, a: Array, focal_px: Array
) -> tuple[Array, Array, Array, tuple[Array, Array], Array]:
    """Return H (6 x 6), g (6), H cross (6 x 2), (H, g) of the focal logarithms, and the points' weights.

    Residual: pixels where the moved point is seen against where the corner was found, and depth; step by `exp(xi) T`.
    """
    scale = np.exp(a)
    earlier = _points(motion.rays_earlier * scale, motion.depth_earlier)
    later = se3.apply(T, earlier)
    z = np.maximum(later[:, 2], 0.1)
    seen = later[:, :2] / z[:, None]
    sigma_z = _DEPTH_SIGMA_AT_1M * np.hypot(motion.depth_earlier**2, motion.depth_later**2)
    per_px = focal_px / _PIXEL_SIGMA
    residual = np.column_stack(
        [(seen / scale - motion.rays_later) * per_px, (later[:, 2] - motion.depth_later) / sigma_z]
    )
    weights = 1.0 / (1.0 + np.square(residual).sum(axis=1) / _CAUCHY)
    by_point = np.zeros((len(z), 3, 3))
    for axis in (0, 1):
        by_point[:, axis, axis] = per_px[axis] / (scale[axis] * z)
        by_point[:, axis, 2] = -per_px[axis] * seen[:, axis] / (scale[axis] * z)
    by_point[:, 2, 2] = 1.0 / sigma_z
    moved = np.zeros((len(z), 3, 6))
    moved[:, :, :3] = np.eye(3)
    moved[:, 0, 4], moved[:, 0, 5] = later[:, 2], -later[:, 1]
    moved[:, 1, 3], moved[:, 1, 5] = -later[:, 2], later[:, 0]
    moved[:, 2, 3], moved[:, 2, 4] = later[:, 1], -later[:, 0]
    J = by_point @ moved
    bent = T[:3, :2][None] * earlier[:, None, :2]
    J_a = by_point @ bent
    for axis in (0, 1):
        J_a[:, axis, axis] -= per_px[axis] * seen[:, axis] / scale[axis]
    weighted = weights[:, None, None] * J
    flat = residual[:, :, None]
    return (
        np.einsum("nij,nik->jk", weighted, J),
        -np.einsum("nij,nik->j", weighted, flat),
        np.einsum("nij,nik->jk", weighted, J_a),
        (
            np.einsum("n,nij,nik->jk", weights, J_a, J_a),
            -np.einsum("n,nij,nik->j", weights, J_a, flat),
        ),
        weights,
    )
