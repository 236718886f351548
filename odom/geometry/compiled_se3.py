"""Steps of a pose inside compiled loops."""

import math

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

_SMALL = 1e-5
"""rad; below it series to the second order are exact to rounding."""


@compiled
def moved(xi: Array, T: Array) -> Array:
    """Return `exp(xi) @ T`, as `se3.exp` has it, of a tangent vector (6, m and rad) and a rigid motion (4 x 4)."""
    r, s, t, x, y, z = xi[0], xi[1], xi[2], xi[3], xi[4], xi[5]
    theta2 = x * x + y * y + z * z
    theta = math.sqrt(theta2)
    if theta < _SMALL:
        a, b, c = 1.0, 0.5, 1.0 / 6.0
    else:
        a = math.sin(theta) / theta
        b = (1.0 - math.cos(theta)) / theta2
        c = (theta - math.sin(theta)) / (theta2 * theta)
    # with W = hat(phi): the rotation is I + a W + b W^2, and the translation (I + b W + c W^2) rho
    xx, yy, zz, xy, xz, yz = -z * z - y * y, -z * z - x * x, -y * y - x * x, x * y, x * z, y * z
    R00, R01, R02 = 1.0 + b * xx, -a * z + b * xy, a * y + b * xz
    R10, R11, R12 = a * z + b * xy, 1.0 + b * yy, -a * x + b * yz
    R20, R21, R22 = -a * y + b * xz, a * x + b * yz, 1.0 + b * zz
    out = np.empty((4, 4))
    for j in range(4):
        t0, t1, t2 = T[0, j], T[1, j], T[2, j]
        out[0, j] = R00 * t0 + R01 * t1 + R02 * t2
        out[1, j] = R10 * t0 + R11 * t1 + R12 * t2
        out[2, j] = R20 * t0 + R21 * t1 + R22 * t2
        out[3, j] = 0.0
    out[0, 3] += (1.0 + c * xx) * r + (-b * z + c * xy) * s + (b * y + c * xz) * t
    out[1, 3] += (b * z + c * xy) * r + (1.0 + c * yy) * s + (-b * x + c * yz) * t
    out[2, 3] += (-b * y + c * xz) * r + (b * x + c * yz) * s + (1.0 + c * zz) * t
    out[3, 3] = 1.0
    return out


@compiled
def put(T: Array, out: Array) -> None:
    """Set `out` to the rigid motion `T` (both 4 x 4): assigning arrays takes numba seconds to compile."""
    for i in range(4):
        for j in range(4):
            out[i, j] = T[i, j]


@compiled
def orthonormalise(T: Array) -> None:
    """Bring the rotation of `T` (4 x 4), drifted by rounding, back onto SO(3), as `se3.orthonormal` does."""
    R = T[:3, :3].copy()
    for i in range(3):
        for j in range(3):
            T[i, j] = 1.5 * R[i, j]
            for k in range(3):
                overlap = R[0, k] * R[0, j] + R[1, k] * R[1, j] + R[2, k] * R[2, j]
                T[i, j] -= 0.5 * R[i, k] * overlap


@compiled
def is_shorter(step: Array, limit: float) -> bool:
    """Return whether all entries of a step (n) are nearer to 0 than `limit`; False where one is NaN."""
    short = 0
    for each in step:
        short += abs(each) < limit
    return short == len(step)


@compiled
def solve_definite(H: Array, g: Array) -> Array:
    """Return x with `H @ x == g` for a symmetric positive definite `H` (n x n); NaN or infinite where it is not."""
    n = len(g)
    L, x = np.zeros((n, n)), g.copy()
    for i in range(n):
        for j in range(i + 1):
            rest = H[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(rest) if i == j and rest > 0.0 else rest / L[j, j]
    for i in range(n):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
    return x
