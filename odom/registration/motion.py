"""Rigid motions in compiled loops: the tangent steps of `se3`, and Horn's rotation by its quaternion."""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from odom.registration.linear import jacobi

Array = NDArray[np.float64]


@compiled
def rotation_of(
    m00: float, m01: float, m02: float, m10: float, m11: float, m12: float, m20: float, m21: float, m22: float, T: Array
) -> None:
    """Set `T[:3, :3]` to the rotation R of largest trace(R M), by Horn's quaternion."""
    # the symmetric matrix whose eigenvector of the largest eigenvalue is the quaternion (w x y z)
    N = np.empty((4, 4))
    N[0, 0] = m00 + m11 + m22
    N[1, 1] = m00 - m11 - m22
    N[2, 2] = m11 - m00 - m22
    N[3, 3] = m22 - m00 - m11
    N[0, 1] = N[1, 0] = m12 - m21
    N[0, 2] = N[2, 0] = m20 - m02
    N[0, 3] = N[3, 0] = m01 - m10
    N[1, 2] = N[2, 1] = m01 + m10
    N[1, 3] = N[3, 1] = m20 + m02
    N[2, 3] = N[3, 2] = m12 + m21
    V = np.eye(4)
    jacobi(N, V)
    best = 0
    for j in range(1, 4):
        if N[j, j] > N[best, best]:
            best = j
    a, x, y, z = V[0, best], V[1, best], V[2, best], V[3, best]
    T[0, 0] = a * a + x * x - y * y - z * z
    T[0, 1] = 2.0 * (x * y - a * z)
    T[0, 2] = 2.0 * (x * z + a * y)
    T[1, 0] = 2.0 * (x * y + a * z)
    T[1, 1] = a * a - x * x + y * y - z * z
    T[1, 2] = 2.0 * (y * z - a * x)
    T[2, 0] = 2.0 * (x * z - a * y)
    T[2, 1] = 2.0 * (y * z + a * x)
    T[2, 2] = a * a - x * x - y * y + z * z


@compiled
def horn(q: Array, p: Array, W: Array, g: Array, T: Array) -> float:
    """Set `T` (4 x 4) to Horn's closed form for scalar weights `g[k] W[k, 6]`; return the sum of the weights."""
    total = 0.0
    sq0 = sq1 = sq2 = sp0 = sp1 = sp2 = 0.0
    m00 = m01 = m02 = m10 = m11 = m12 = m20 = m21 = m22 = 0.0
    for k in range(len(q)):
        w = g[k] * W[k, 6]
        if w <= 0.0:
            continue
        x, y, z = w * q[k, 0], w * q[k, 1], w * q[k, 2]
        u, v, s = p[k, 0], p[k, 1], p[k, 2]
        total += w
        sq0 += x
        sq1 += y
        sq2 += z
        sp0 += w * u
        sp1 += w * v
        sp2 += w * s
        m00 += x * u
        m01 += x * v
        m02 += x * s
        m10 += y * u
        m11 += y * v
        m12 += y * s
        m20 += z * u
        m21 += z * v
        m22 += z * s
    if not total > 0.0:
        return 0.0
    i = 1.0 / total
    m00 -= sq0 * sp0 * i
    m01 -= sq0 * sp1 * i
    m02 -= sq0 * sp2 * i
    m10 -= sq1 * sp0 * i
    m11 -= sq1 * sp1 * i
    m12 -= sq1 * sp2 * i
    m20 -= sq2 * sp0 * i
    m21 -= sq2 * sp1 * i
    m22 -= sq2 * sp2 * i
    rotation_of(m00, m01, m02, m10, m11, m12, m20, m21, m22, T)
    T[0, 3] = (sp0 - T[0, 0] * sq0 - T[0, 1] * sq1 - T[0, 2] * sq2) * i  # eq. (4)
    T[1, 3] = (sp1 - T[1, 0] * sq0 - T[1, 1] * sq1 - T[1, 2] * sq2) * i
    T[2, 3] = (sp2 - T[2, 0] * sq0 - T[2, 1] * sq1 - T[2, 2] * sq2) * i
    T[3, 0] = T[3, 1] = T[3, 2] = 0.0
    T[3, 3] = 1.0
    return total


@compiled
def compose_tangent(T: Array, xi: Array) -> None:
    """Replace `T` by `T @ exp(xi)`, xi = (rho, phi), through a unit quaternion."""
    x, y, z = xi[3], xi[4], xi[5]
    theta = np.sqrt(x * x + y * y + z * z)
    half = np.sin(0.5 * theta) / theta if theta > 1e-9 else 0.5
    w = np.cos(0.5 * theta)
    a = (1.0 - np.cos(theta)) / (theta * theta) if theta > 1e-4 else 0.5
    c = (theta - np.sin(theta)) / (theta * theta * theta) if theta > 1e-2 else 1.0 / 6.0
    dot = x * xi[0] + y * xi[1] + z * xi[2]
    d0 = xi[0] + a * (y * xi[2] - z * xi[1]) + c * (x * dot - theta * theta * xi[0])
    d1 = xi[1] + a * (z * xi[0] - x * xi[2]) + c * (y * dot - theta * theta * xi[1])
    d2 = xi[2] + a * (x * xi[1] - y * xi[0]) + c * (z * dot - theta * theta * xi[2])
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
