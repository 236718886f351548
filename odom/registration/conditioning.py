"""Covariance and conditioning of a solution, and the spread of the points that it was computed from."""

from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from odom.registration.linear_algebra import cholesky, jacobi, substitute


class Geometry(NamedTuple):
    """How well pairs determine a motion; all 0 where H is singular.

    `conditioning` is the reciprocal condition number of H about the centroid with rotations scaled by the points'
    spread (0 for points in one place); `scatter` the second eigenvalue of the points' scatter in units of their noise
    variance, `thickness` that eigenvalue relative to the first.
    """

    is_regular: bool
    conditioning: float
    scatter: float
    thickness: float


@compiled
def scatter(q: Array, W: Array, g: Array, mean: Array, S: Array) -> tuple[float, float]:
    """Set `S` (3 x 3) to `sum w (q - mean)(q - mean)'` and `mean` (3) to `sum w q / sum w`, with w = g W[:, 6].

    Returns the number of pairs of positive weight, and the sum of the weights.
    """
    used = total = 0.0
    mx = my = mz = 0.0
    xx = xy = xz = yy = yz = zz = 0.0
    a, b, c = q[0, 0], q[0, 1], q[0, 2]  # sums are taken about the first point, so that no digits are lost
    for k in range(len(q)):
        w = g[k] * W[k, 6]
        if w > 0.0:
            x, y, z = q[k, 0] - a, q[k, 1] - b, q[k, 2] - c
            used += 1.0
            total += w
            mx += w * x
            my += w * y
            mz += w * z
            xx += w * x * x
            xy += w * x * y
            xz += w * x * z
            yy += w * y * y
            yz += w * y * z
            zz += w * z * z
    mx, my, mz = mx / total, my / total, mz / total
    S[0, 0], S[1, 1], S[2, 2] = xx - total * mx * mx, yy - total * my * my, zz - total * mz * mz
    S[0, 1] = S[1, 0] = xy - total * mx * my
    S[0, 2] = S[2, 0] = xz - total * mx * mz
    S[1, 2] = S[2, 1] = yz - total * my * mz
    mean[0], mean[1], mean[2] = mx + a, my + b, mz + c
    return used, total


@compiled
def assess(q: Array, W: Array, g: Array, H: Array, covariance: Array) -> Geometry:
    """Set `covariance` (6 x 6) to the inverse of `H` and return the geometry of the pairs with `g` > 0."""
    m = H.shape[0]
    e = np.zeros(m)
    L = H.copy()
    if not cholesky(L):
        return Geometry(False, 0.0, 0.0, 0.0)
    for k in range(m):
        e[k] = 1.0
        substitute(L, e, covariance[k])
        e[k] = 0.0
    # eigenvalues of the scatter: of points on a line two are 0
    mean, S, none = np.empty(3), np.empty((3, 3)), np.empty((0, 0))
    used, total = scatter(q, W, g, mean, S)
    spread = np.sqrt((S[0, 0] + S[1, 1] + S[2, 2]) / total)
    jacobi(S, none)
    a, b, c = S[0, 0], S[1, 1], S[2, 2]
    largest = max(a, max(b, c))
    second = a + b + c - largest - min(a, min(b, c))
    conditioning = scaled_conditioning(H, mean, spread)
    return Geometry(True, conditioning, second / used, second / largest if largest > 0.0 else 0.0)


@compiled
def scaled_conditioning(H: Array, mean: Array, spread: float) -> float:
    """Return the reciprocal condition number of `H` (6 x 6) about the points' `mean` (3), rotations by their `spread`.

    `spread` (m) is the root of the mean squared distance of the points from their mean; 0 where it is not positive.
    """
    if not spread > 0.0:
        return 0.0
    m = H.shape[0]
    # C = B'H B: rotation about the centroid, arc length as the unit, xi = B xi', B = [I, hat(mean)/spread; 0, I/spread]
    B = np.eye(m)
    s = 1.0 / spread
    for i in range(3):
        B[3 + i, 3 + i] = s
    B[0, 4], B[0, 5] = -s * mean[2], s * mean[1]
    B[1, 3], B[1, 5] = s * mean[2], -s * mean[0]
    B[2, 3], B[2, 4] = -s * mean[1], s * mean[0]
    L, C = np.empty((m, m)), np.zeros((m, m))
    for i in range(m):
        for j in range(m):
            L[i, j] = 0.0
            for k in range(m):
                L[i, j] += H[i, k] * B[k, j]
    for i in range(m):
        for j in range(m):
            for k in range(m):
                C[i, j] += B[k, i] * L[k, j]
    # its extreme eigenvalues
    jacobi(C, np.empty((0, 0)))
    low = high = C[0, 0]
    for i in range(m):
        low, high = min(low, C[i, i]), max(high, C[i, i])
    return float(max(low, 0.0) / high)
