"""Rigid motions and their tangent space inside compiled loops; `se3` has the same in numpy.

Where a function names a small angle, the first terms of a series stand for it below, exact to nine digits or more.
"""

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
def compose_tangent(T: Array, xi: Array) -> None:
    """Replace `T` by `T @ exp(xi)`, xi = (rho, phi), by the unit quaternion of phi and the left Jacobian of SO(3)."""
    x, y, z = xi[3], xi[4], xi[5]
    theta = np.sqrt(x * x + y * y + z * z)
    half = np.sin(0.5 * theta) / theta if theta > 1e-9 else 0.5
    w = np.cos(0.5 * theta)
    a = (1.0 - np.cos(theta)) / (theta * theta) if theta > 1e-4 else 0.5
    c = (theta - np.sin(theta)) / (theta * theta * theta) if theta > 1e-2 else 1.0 / 6.0
    # d = J rho = rho + a phi x rho + c phi x (phi x rho)
    dot = x * xi[0] + y * xi[1] + z * xi[2]
    d0 = xi[0] + a * (y * xi[2] - z * xi[1]) + c * (x * dot - theta * theta * xi[0])
    d1 = xi[1] + a * (z * xi[0] - x * xi[2]) + c * (y * dot - theta * theta * xi[1])
    d2 = xi[2] + a * (x * xi[1] - y * xi[0]) + c * (z * dot - theta * theta * xi[2])
    # t += R d, R times the rotation of the quaternion (w x y z)
    x, y, z = half * x, half * y, half * z
    for i in range(3):
        r0, r1, r2 = T[i, 0], T[i, 1], T[i, 2]
        T[i, 3] += r0 * d0 + r1 * d1 + r2 * d2
        T[i, 0] = r0 * (1 - 2 * (y * y + z * z)) + r1 * 2 * (x * y + w * z) + r2 * 2 * (x * z - w * y)
        T[i, 1] = r0 * 2 * (x * y - w * z) + r1 * (1 - 2 * (x * x + z * z)) + r2 * 2 * (y * z + w * x)
        T[i, 2] = r0 * 2 * (x * z + w * y) + r1 * 2 * (y * z - w * x) + r2 * (1 - 2 * (x * x + y * y))


@compiled
def relative_tangent(T: Array, T0: Array, xi: Array) -> None:
    """Set `xi` (6, m and rad) to log(inverse(T0) T), as `se3.log` has it but for digits beside a half turn."""
    t = np.zeros(3)
    for k in range(3):
        for i in range(3):
            t[k] += T0[i, k] * (T[i, 3] - T0[i, 3])
    D = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                D[i, j] += T0[k, i] * T[k, j]
    x, y, z = D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]
    s = 0.5 * np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(s, 0.5 * (D[0, 0] + D[1, 1] + D[2, 2] - 1.0))
    f = 0.5 * angle / s if s > 1e-9 else 0.5
    x, y, z = f * x, f * y, f * z
    # the inverse of the left Jacobian: rho = t - phi x t / 2 + d phi x (phi x t)
    d = (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / (angle * angle) if angle > 1e-4 else 1.0 / 12.0
    u, v, w = y * t[2] - z * t[1], z * t[0] - x * t[2], x * t[1] - y * t[0]
    xi[0] = t[0] - 0.5 * u + d * (y * w - z * v)
    xi[1] = t[1] - 0.5 * v + d * (z * u - x * w)
    xi[2] = t[2] - 0.5 * w + d * (x * v - y * u)
    xi[3], xi[4], xi[5] = x, y, z


@compiled
def inverse_right_jacobian(xi: Array, J: Array) -> None:
    """Set `J` (6 x 6) to d log(exp(xi) exp(d)) / d d at d = 0: how a tangent vector (6) grows by what comes after it.

    With A = [hat(phi), hat(rho); 0, hat(phi)] it is `I + A / 2 + a A^2 + b A^4`, the Bernoulli series summed: J. Selig,
    "Geometric Fundamentals of Robotics", 2005, chapter 4.
    """
    theta = math.sqrt(xi[3] * xi[3] + xi[4] * xi[4] + xi[5] * xi[5])
    if theta < 0.03:
        a, b = 1.0 / 12.0, -1.0 / 720.0
    else:
        sine, c = math.sin(theta), 4.0 * (math.cos(theta) - 1.0)
        a = 2.0 / theta**2 + (theta + 3.0 * sine) / (theta * c)
        b = 1.0 / theta**4 + (theta + sine) / (theta**3 * c)
    A = np.zeros((6, 6))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        A[j, i] = A[3 + j, 3 + i] = xi[3 + k]
        A[i, j] = A[3 + i, 3 + j] = -xi[3 + k]
        A[j, 3 + i], A[i, 3 + j] = xi[k], -xi[k]
    A2, A4 = np.zeros((6, 6)), np.zeros((6, 6))
    product(A, A, A2)
    product(A2, A2, A4)
    for i in range(6):
        for j in range(6):
            J[i, j] = (1.0 if i == j else 0.0) + 0.5 * A[i, j] + a * A2[i, j] + b * A4[i, j]


@compiled
def product(A: Array, B: Array, out: Array) -> None:
    """Add `A B` to `out` (all n x n)."""
    for i in range(len(A)):
        for j in range(len(A)):
            for k in range(len(A)):
                out[i, j] += A[i, k] * B[k, j]


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
