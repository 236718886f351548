"""The pose of a frame against landmarks: robust, covariance-weighted, in the measured coordinates (x/z, y/z, 1/z).

An iterated information filter: every landmark adds J' inv(S) J, with S the measurement's covariance plus the
landmark's own, carried through the projection P: S = Sp + P Sq P' (the paper's uncertain measurement matrix by its
exact second moment; see the robust recursion in `odom.registration`). Ray and depth each have a Cauchy weight.
"""

from dataclasses import dataclass

import numpy as np

from odom.backend.tracking.pose_information import NEAREST_M, add_up, chi2_in_blocks, in_blocks
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.rolling_shutter import interaction_matrix
from odom.geometry.arrays import Array, Mask
from odom.geometry.compiled import compiled
from odom.geometry.compiled_se3 import is_shorter, moved, orthonormalise, solve_definite

_CONVERGED = 1e-5
"""Step (m, rad) below which the fit ends: a hundredth of the best pose's sigma; later steps would be smaller still."""
_PRIOR = 1e-6
"""Information (1/m^2, 1/rad^2) that keeps the start where the landmarks say nothing; otherwise it has no effect."""
_ITERATIONS = 10
"""Gauss-Newton steps at the most; three or four are the rule."""


@compiled
def projection_terms(T: Array, p: Array, value: Array, J: Array, P: Array, r: Array) -> bool:
    """Fill residual r (3), d/d(pose) J (3 x 6), d/d(point) P (3 x 3) of one point `p` measured as `value` (3).

    The pose's perturbation is on the left, exp(xi) @ T_camera_map; the residual's third entry is 0 without depth.
    Returns False when the point lies behind the camera.
    """
    X = T[0, 0] * p[0] + T[0, 1] * p[1] + T[0, 2] * p[2] + T[0, 3]
    Y = T[1, 0] * p[0] + T[1, 1] * p[1] + T[1, 2] * p[2] + T[1, 3]
    Z = T[2, 0] * p[0] + T[2, 1] * p[1] + T[2, 2] * p[2] + T[2, 3]
    if Z < NEAREST_M:
        return False
    w = 1.0 / Z
    x, y = X * w, Y * w
    r[0], r[1] = value[0] - x, value[1] - y
    r[2] = value[2] - w if value[2] > 0.0 else 0.0
    interaction_matrix(x, y, w, J)
    for c in range(3):
        P[0, c] = w * (T[0, c] - x * T[2, c])
        P[1, c] = w * (T[1, c] - y * T[2, c])
        P[2, c] = -w * w * T[2, c]
    return True


@compiled
def projected(T: Array, points: Array, k: int) -> tuple[float, float, float]:
    """Return x/z, y/z and 1/z of point `k` of `points` (n x 3, m), seen from the pose `T`; 0 where it lies behind."""
    p0, p1, p2 = points[k, 0], points[k, 1], points[k, 2]
    Z = T[2, 0] * p0 + T[2, 1] * p1 + T[2, 2] * p2 + T[2, 3]
    if Z < NEAREST_M:
        return 0.0, 0.0, 0.0
    w = 1.0 / Z
    X = T[0, 0] * p0 + T[0, 1] * p1 + T[0, 2] * p2 + T[0, 3]
    Y = T[1, 0] * p0 + T[1, 1] * p1 + T[1, 2] * p2 + T[1, 3]
    return X * w, Y * w, w


@compiled
def _times(C: Array, k: int, a: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return `C[k] a` for symmetric matrices C (n x 3 x 3)."""
    return (
        C[k, 0, 0] * a[0] + C[k, 0, 1] * a[1] + C[k, 0, 2] * a[2],
        C[k, 0, 1] * a[0] + C[k, 1, 1] * a[1] + C[k, 1, 2] * a[2],
        C[k, 0, 2] * a[0] + C[k, 1, 2] * a[1] + C[k, 2, 2] * a[2],
    )


@compiled
def _dot(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def robust_information(
    T: Array, seen: tuple[float, float, float], C: Array, values: Array, variances: Array, k: int, cauchy: float
) -> tuple[float, float, float, float, float, float]:
    """Return chi2 of ray and depth (0 without), and a measurement's robust information: I_xx, I_xy, I_yy and I_ww.

    Landmark `k`, of covariance `C` (n x 3 x 3), is predicted to be `seen` (x/z, y/z, 1/z) from the pose `T`, and was
    measured as `values` (n x 3) with `variances` (n x 4, see `Measurements`). Its own covariance is carried through the
    projection; the Cauchy weight is one half at a chi2 of `cauchy`. No array is sliced: that would double the time.
    """
    x, y, w = seen
    by_x = (w * (T[0, 0] - x * T[2, 0]), w * (T[0, 1] - x * T[2, 1]), w * (T[0, 2] - x * T[2, 2]))
    by_y = (w * (T[1, 0] - y * T[2, 0]), w * (T[1, 1] - y * T[2, 1]), w * (T[1, 2] - y * T[2, 2]))
    C_x, C_y = _times(C, k, by_x), _times(C, k, by_y)
    sxx, sxy = variances[k, 0] + _dot(by_x, C_x), variances[k, 1] + _dot(by_y, C_x)
    syy = variances[k, 2] + _dot(by_y, C_y)
    rx, ry = values[k, 0] - x, values[k, 1] - y
    inverse = 1.0 / (sxx * syy - sxy * sxy)
    ray = (syy * rx * rx - 2.0 * sxy * rx * ry + sxx * ry * ry) * inverse
    weight = inverse / (1.0 + ray / cauchy)
    depth, iww = 0.0, 0.0
    if values[k, 2] > 0.0:
        by_w = (-w * w * T[2, 0], -w * w * T[2, 1], -w * w * T[2, 2])
        sww, rw = variances[k, 3] + _dot(by_w, _times(C, k, by_w)), values[k, 2] - w
        depth = rw * rw / sww
        iww = 1.0 / (sww * (1.0 + depth / cauchy))
    return ray, depth, syy * weight, -sxy * weight, sxx * weight, iww


@dataclass(frozen=True, eq=False)
class PoseFit:
    """`T_camera_map`, its information matrix (6 x 6, left perturbation, camera frame), chi2 (n x 2: ray, depth).

    `chi2` is 0 for what was not used, and huge for a point behind the camera.
    """

    T_camera_map: Array
    information: Array
    chi2: Array


def fit_pose(
    points_map: Array,
    covariances_map: Array,
    values: Array,
    variances: Array,
    T_camera_map: Array,
    used: Mask | None = None,
    iterations: int = _ITERATIONS,
    cauchy: float = TUNING.cauchy_chi2,
) -> PoseFit:
    """Fit the pose of a frame that measured n landmarks, from the start `T_camera_map`.

    `points_map` (n x 3 m) with `covariances_map` (n x 3 x 3 m^2); `values` (n x 3) and `variances` (n x 4) as in
    `Measurements`; `used` (n) says which of them count, `cauchy` at which chi-squared a weight is one half.
    """
    chosen = np.ones(len(points_map), dtype=np.bool_) if used is None else used
    return PoseFit(
        *_fitted(points_map, covariances_map, values, variances, T_camera_map, chosen, iterations, float(cauchy))
    )


@compiled
def chi2_of(points_map: Array, covariances_map: Array, values: Array, variances: Array, T_camera_map: Array) -> Array:
    """Return chi2 (n x 2: ray, depth) of what a frame measured of n landmarks, at the pose `T_camera_map`.

    The arguments are those of `fit_pose`; chi2 is huge for a point behind the camera.
    """
    return chi2_in_blocks(T_camera_map, in_blocks(points_map, covariances_map, values, variances), len(points_map))


@compiled
def _fitted(
    points: Array,
    covariances: Array,
    values: Array,
    variances: Array,
    T_start: Array,
    used: Mask,
    iterations: int,
    cauchy: float,
) -> tuple[Array, Array, Array]:
    """Return the pose after some Gauss-Newton steps, its information with the prior's, and chi2 (n x 2) there."""
    T = T_start.copy()
    prior, away = _PRIOR * np.eye(6), np.zeros(6)
    blocks = in_blocks(points, covariances, values, variances)
    H, g, chi2 = add_up(T, blocks, used, cauchy)
    for _ in range(iterations):
        step = solve_definite(H + prior, g - _PRIOR * away)
        T = moved(step, T)
        away += step
        H, g, chi2 = add_up(T, blocks, used, cauchy)
        if is_shorter(step, _CONVERGED):
            break
    orthonormalise(T)
    return T, H + prior, chi2
