"""Steps along the tangent space of SE(3) in compiled loops; `odom.geometry.se3` has the same in numpy.

Below the small angles in the code the first term of a series stands for it, exact to nine digits or more.
"""

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled


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
    """Set `xi` to log(inverse(T0) T), but for terms of second order in the translation."""
    for k in range(3):
        xi[k] = 0.0
        for i in range(3):
            xi[k] += T0[i, k] * (T[i, 3] - T0[i, 3])
    D = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                D[i, j] += T0[k, i] * T[k, j]
    x, y, z = D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]
    s = 0.5 * np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(s, 0.5 * (D[0, 0] + D[1, 1] + D[2, 2] - 1.0))
    f = 0.5 * angle / s if s > 1e-9 else 0.5
    xi[3], xi[4], xi[5] = f * x, f * y, f * z


@compiled
def tangent_basis(T: Array, B: Array) -> None:
    """Set `B` (12 x 6) to d vec[R | t] / d(rho, phi) at `T @ exp(xi)`: row i of `R hat(e_k)` is R's row i cross e_k."""
    B[:] = 0.0
    for i in range(3):
        x, y, z = T[i, 0], T[i, 1], T[i, 2]
        r = 4 * i
        B[r + 3, 0], B[r + 3, 1], B[r + 3, 2] = x, y, z
        B[r + 1, 3], B[r + 2, 3] = z, -y
        B[r, 4], B[r + 2, 4] = -z, x
        B[r, 5], B[r + 1, 5] = y, -x
