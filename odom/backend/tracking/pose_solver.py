"""The pose of a frame against landmarks: robust, covariance-weighted, in the measured coordinates (x/z, y/z, 1/z).

An iterated information filter: every landmark adds J' inv(S) J, with S the measurement's covariance plus the
landmark's own, carried through the projection P: S = Sp + P Sq P' (the paper's uncertain measurement matrix by its
exact second moment; see the robust recursion in `odom.registration`). Cauchy weights for ray and depth apart.
"""

from dataclasses import dataclass

import numpy as np

from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.rolling_shutter import interaction_matrix
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.geometry.compiled import compiled

_NEAREST_M = 0.05
"""Nearer points count as behind the camera: no depth camera measures so near, and 1/z would run away."""
_BEHIND_CAMERA_CHI2 = 1e9
"""Stands for a point behind the camera: far above any gate."""
_CONVERGED = 1e-6
"""Step (m, rad) below which the fit ends: a thousandth of the best pose's sigma."""
_PRIOR = 1e-6
"""Information (1/m^2, 1/rad^2) that keeps the start where the landmarks say nothing; it is never felt otherwise."""
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
    if Z < _NEAREST_M:
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
def robust_information(
    P: Array, C: Array, r: Array, variance: Array, has_depth: bool, cauchy: float, PC: Array
) -> tuple[float, float, float, float, float, float]:
    """Return chi2 of the ray and of the depth (0 without), and what a measurement says: I_xx, I_xy, I_yy and I_ww.

    Residual `r` (3) has the measurement's `variance` (4, see `Measurements`) and the landmark's own, `C` (3 x 3)
    through `P` (3 x 3); the Cauchy weight is one half at a chi2 of `cauchy`. `PC` (3 x 3) is room to work in.
    """
    for a in range(3):
        for b in range(3):
            PC[a, b] = P[a, 0] * C[0, b] + P[a, 1] * C[1, b] + P[a, 2] * C[2, b]
    sxx = variance[0] + PC[0, 0] * P[0, 0] + PC[0, 1] * P[0, 1] + PC[0, 2] * P[0, 2]
    sxy = variance[1] + PC[0, 0] * P[1, 0] + PC[0, 1] * P[1, 1] + PC[0, 2] * P[1, 2]
    syy = variance[2] + PC[1, 0] * P[1, 0] + PC[1, 1] * P[1, 1] + PC[1, 2] * P[1, 2]
    determinant = sxx * syy - sxy * sxy
    ray = (syy * r[0] * r[0] - 2.0 * sxy * r[0] * r[1] + sxx * r[1] * r[1]) / determinant
    weight = 1.0 / (1.0 + ray / cauchy)
    ixx, ixy, iyy = syy / determinant * weight, -sxy / determinant * weight, sxx / determinant * weight
    depth, iww = 0.0, 0.0
    if has_depth:
        sww = variance[3] + PC[2, 0] * P[2, 0] + PC[2, 1] * P[2, 1] + PC[2, 2] * P[2, 2]
        depth = r[2] * r[2] / sww
        iww = 1.0 / (1.0 + depth / cauchy) / sww
    return ray, depth, ixx, ixy, iyy, iww


@compiled
def _accumulate(
    T: Array, points: Array, covariances: Array, values: Array, variances: Array, used: Mask, cauchy: float
) -> tuple[Array, Array, Array]:
    """Return H = sum J' inv(S) J (6 x 6), g = sum J' inv(S) r (6) and chi2 (n x 2: ray, depth) at the pose `T`."""
    n = points.shape[0]
    H = np.zeros((6, 6))
    g = np.zeros(6)
    chi2 = np.zeros((n, 2))
    J = np.zeros((3, 6))
    P = np.zeros((3, 3))
    r = np.zeros(3)
    PC = np.zeros((3, 3))
    for k in range(n):
        if not used[k]:
            continue
        if not projection_terms(T, points[k], values[k], J, P, r):
            chi2[k, 0] = _BEHIND_CAMERA_CHI2
            continue
        chi2[k, 0], chi2[k, 1], ixx, ixy, iyy, iww = robust_information(
            P, covariances[k], r, variances[k], values[k, 2] > 0.0, cauchy, PC
        )
        for a in range(6):
            j0 = ixx * J[0, a] + ixy * J[1, a]
            j1 = ixy * J[0, a] + iyy * J[1, a]
            j2 = iww * J[2, a]
            g[a] += j0 * r[0] + j1 * r[1] + j2 * r[2]
            for b in range(a, 6):
                H[a, b] += j0 * J[0, b] + j1 * J[1, b] + j2 * J[2, b]
    for a in range(6):
        for b in range(a):
            H[a, b] = H[b, a]
    return H, g, chi2


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
    T = T_camera_map.copy()
    prior = _PRIOR * np.eye(6)
    away = np.zeros(6)
    H, g, chi2 = _accumulate(T, points_map, covariances_map, values, variances, chosen, cauchy)
    for _ in range(iterations):
        step: Array = np.asarray(np.linalg.solve(H + prior, g - prior @ away), dtype=np.float64)
        T = se3.exp(step) @ T
        away = away + step
        H, g, chi2 = _accumulate(T, points_map, covariances_map, values, variances, chosen, cauchy)
        if np.abs(step).max() < _CONVERGED:
            break
    return PoseFit(se3.orthonormal(T), H + prior, chi2)
