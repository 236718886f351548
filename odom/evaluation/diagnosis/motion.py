"""Camera motion between frames from corners with depth on both sides, and the focal lengths that fit it best.

A rigid motion must explain both how corners move in the image and how their depths change. A wrong focal length bends
the back-projected points, and no rigid motion explains both once the camera has turned; so the ratio `exp(a)` of the
given to the true focal lengths is solved for together with the motions of many pairs of frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from odom.evaluation.alignment import align
from odom.evaluation.diagnosis.tracks import Tracks
from odom.evaluation.sandwich import sandwich_sigma
from odom.geometry import se3
from odom.geometry.arrays import Array

_PIXEL_SIGMA = 0.7
"""Noise (px) of a followed corner; with the depth's it only sets how image and depth share the fit."""
_DEPTH_SIGMA_AT_1M = 0.003
"""Noise (m) of a corner's depth at 1 m, growing with its square: twice a Kinect v1's, as corners lie near edges."""
_CAUCHY = 9.0
"""Squared residual (3 on average) that halves a corner's weight: smaller wastes corners, larger lets slips in."""
_LEAST_POINTS = 25
"""Corners that a motion needs: fewer give wrong motions, a higher bound leaves pairs out."""
_FARTHEST_M, _FARTHEST_SHARE = 4.0, 1.5
"""Depth beyond which a structured-light sensor is too rough to help; where half of the corners lie farther, as by a
wrong depth unit, those up to this multiple of the usual depth are used."""
_NEAREST_M = 0.1
"""No point may come nearer to the camera in an iteration, where its projection would explode."""
_LEAST_WEIGHT, _LEAST_INLIERS = 0.4, 0.4
"""A corner fits by a weight above the first; a motion holds when a share above the second fits."""
_START_ROUNDS, _START_MEDIANS, _START_SHARE = 6, 2.5, 0.004
"""Rounds of the closed-form start, and the errors it keeps: in medians, and as a share of depth at least."""
_PAIR_ITERATIONS, _CONVERGED = 12, 1e-7
"""Gauss-Newton steps at most (some five are needed), ended by a smaller step (m, rad)."""
_LEAST_PAIRS, _FOCAL_ITERATIONS, _LARGEST_STEP = 8, 8, 0.15
"""Fit of focal lengths: the pairs of frames it needs, its iterations, and the largest step of a logarithm."""
_FOCAL_INFORMATION = 1e-3
"""Information of a prior on the logarithms, far below that of any turn of the camera: it keeps the fit solvable without
a turn."""
_DAMPING = 1e-9
"""Share of the trace added to a motion's information, for corners that leave a direction free."""
_GROUPS = (2, 10)
"""Groups of successive pairs, for the standard deviation: errors are correlated within a group, over half a second or
half the recording. On fr1_xyz from 9 s on, ten groups alone claim 4 % where the halves differ by 25 %."""


@dataclass(frozen=True, eq=False)
class PairMotion:
    """Motion of the camera between two frames: `T_later_earlier` maps points.

    `rays_*` (n x 2) and `depth_*` (n, m) are the corners seen in both, `seconds` is the time between the frames.
    """

    earlier: int
    later: int
    T_later_earlier: Array
    rays_earlier: Array
    depth_earlier: Array
    rays_later: Array
    depth_later: Array
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class FocalFit:
    """Ratios of given to fitted focal lengths, x and y, and the standard deviations of their logarithms."""

    ratio: Array
    sigma: Array


def pair_motion(tracks: Sequence[Tracks], earlier: int, later: int, focal_px: Array) -> PairMotion | None:
    """Return the motion between two frames, None when too few corners with depth are seen in both."""
    a, b = tracks[earlier], tracks[later]
    _, in_a, in_b = np.intersect1d(a.ids, b.ids, assume_unique=True, return_indices=True)
    z_a, z_b = a.depth_m[in_a], b.depth_m[in_b]
    good = np.isfinite(z_a) & np.isfinite(z_b)
    if good.any():
        farthest = max(_FARTHEST_M, _FARTHEST_SHARE * float(np.median(z_a[good])))
        good &= (z_a < farthest) & (z_b < farthest)
    if good.sum() < _LEAST_POINTS:
        return None
    rays_a, rays_b, z_a, z_b = a.rays[in_a][good], b.rays[in_b][good], z_a[good], z_b[good]
    start = _robust_start(_points(rays_a, z_a), _points(rays_b, z_b))
    motion = PairMotion(earlier, later, start, rays_a, z_a, rays_b, z_b)
    for _ in range(_PAIR_ITERATIONS):
        H, g, weights = _normal_equations(motion, np.zeros(2), focal_px)
        step = np.asarray(np.linalg.solve(_damped(H), g[:6]), dtype=np.float64)
        motion = replace(motion, T_later_earlier=se3.exp(step) @ motion.T_later_earlier)
        if np.abs(step).max() < _CONVERGED:
            break
    return motion if float((weights > _LEAST_WEIGHT).mean()) > _LEAST_INLIERS else None


def fit_focal(motions: Sequence[PairMotion], focal_px: Array) -> FocalFit | None:
    """Return the focal lengths that let rigid motions explain all pairs best, None for fewer than eight pairs.

    The motions are eliminated from the normal equations (Schur complement), which leaves a 2 x 2 system.
    """
    if len(motions) < _LEAST_PAIRS:
        return None
    a = np.zeros(2)
    for _ in range(_FOCAL_ITERATIONS):
        information, gradients, steps = _FOCAL_INFORMATION * np.eye(2), [], []
        for motion in motions:
            H, g, _ = _normal_equations(motion, a, focal_px)
            solved = np.linalg.solve(_damped(H), np.column_stack([H[:6, 6:], g[:6]]))
            information = information + H[6:, 6:] - H[6:, :6] @ solved[:, :2]
            gradients.append(g[6:] - H[6:, :6] @ solved[:, 2])
            steps.append(solved)
        step = np.linalg.solve(information, np.sum(gradients, axis=0))
        step = np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
        a = a + step
        motions = [
            replace(motion, T_later_earlier=se3.exp(s[:, 2] - s[:, :2] @ step) @ motion.T_later_earlier)
            for s, motion in zip(steps, motions, strict=True)
        ]
    scores = np.array(gradients)
    sigma = np.max([sandwich_sigma(information, scores, min(groups, len(motions))) for groups in _GROUPS], axis=0)
    return FocalFit(np.exp(a), sigma)


def _damped(H: Array) -> Array:
    return np.asarray(H[:6, :6] + _DAMPING * np.trace(H[:6, :6]) * np.eye(6))


def _points(rays: Array, depth_m: Array) -> Array:
    return np.column_stack([rays * depth_m[:, None], depth_m])


def _robust_start(points_earlier: Array, points_later: Array) -> Array:
    """Return a motion by closed form, fitted several times without the points that fit worst."""
    keep = np.ones(len(points_earlier), dtype=bool)
    for _ in range(_START_ROUNDS):
        T = align(points_earlier[keep], points_later[keep]).T_truth_estimate
        error = np.linalg.norm(se3.apply(T, points_earlier) - points_later, axis=1) / points_later[:, 2]
        keep = error <= max(_START_MEDIANS * float(np.median(error)), _START_SHARE)
    return T


def _normal_equations(motion: PairMotion, a: Array, focal_px: Array) -> tuple[Array, Array, Array]:
    """Return H (8 x 8), g (8) and the weights of the points: six of the motion, by `exp(xi) T`, and two of `a`.

    Residuals of a point: its moved position in the image against the corner that was found, and its depth.
    """
    # the later frame's view of the earlier one's points, with the focal lengths given / exp(a)
    scale = np.exp(a)
    earlier = _points(motion.rays_earlier * scale, motion.depth_earlier)
    later = se3.apply(motion.T_later_earlier, earlier)
    z = np.maximum(later[:, 2:], _NEAREST_M)
    seen = later[:, :2] / z
    per_ray = focal_px / (_PIXEL_SIGMA * scale)
    sigma_z = _DEPTH_SIGMA_AT_1M * np.hypot(motion.depth_earlier**2, motion.depth_later**2)
    residual = np.column_stack(
        [(seen - motion.rays_later * scale) * per_ray, (later[:, 2] - motion.depth_later) / sigma_z]
    )
    weights = 1.0 / (1.0 + np.square(residual).sum(axis=1) / _CAUCHY)
    # d residual / d point, and d point / d (xi, a): [1, -hat(p)] and R times the earlier point's x and y
    by_point = np.zeros((len(z), 3, 3))
    by_point[:, (0, 1), (0, 1)] = per_ray / z
    by_point[:, :2, 2] = -per_ray * seen / z
    by_point[:, 2, 2] = 1.0 / sigma_z
    moved = np.zeros((len(z), 3, 8))
    moved[:, :, :3] = np.eye(3)
    moved[:, :, 3:6] = -se3.hats(later)
    moved[:, :, 6:] = motion.T_later_earlier[:3, :2] * earlier[:, None, :2]
    J = by_point @ moved
    J[:, (0, 1), (6, 7)] -= per_ray * seen
    weighted = weights[:, None, None] * J
    return np.einsum("nij,nik->jk", weighted, J), -np.einsum("nij,ni->j", weighted, residual), weights
