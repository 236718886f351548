"""The projection onto SE(3) weighted by the information, and how far its result may be trusted."""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from odom.registration.linear import cholesky, cholesky_solve, jacobi, substitute
from odom.registration.motion import compose_tangent, relative_tangent, tangent_basis

Array = NDArray[np.float64]


@compiled
def normal_equations(Y: Array, y: Array, T: Array, H: Array, g: Array) -> None:
    """Set `H = B'Y B` and `g = B'(y - Y vec T)` (6 x 6, 6): a Gauss-Newton step of the projection.

    Loop bounds are taken from the arrays, so that the compiler does not unroll what need not be.
    """
    n, m = Y.shape[0], H.shape[0]
    B = np.empty((n, m))
    tangent_basis(T, B)
    H[:] = 0.0
    g[:] = 0.0
    YB = np.empty(m)
    for i in range(n):
        YB[:] = 0.0
        e = y[i]
        for j in range(n):
            e -= Y[i, j] * T[j // 4, j % 4]
            for k in range(m):
                YB[k] += Y[i, j] * B[j, k]
        for k in range(m):
            g[k] += B[i, k] * e
            if B[i, k] != 0.0:
                for j in range(m):
                    H[k, j] += B[i, k] * YB[j]


@compiled
def project(Y: Array, y: Array, Y0: Array, T0: Array, T: Array, H: Array) -> int:
    """Move `T` to the minimum over SE(3) of `x'Yx - 2 y'x`, plus a prior of information `Y0` (6 x 6 or empty).

    The prior lies at `T0`. Y (12 x 12) need not be regular (points in a plane): `B'Y B` is enough. Returns the number
    of Gauss-Newton steps, or 0 when the information does not determine the motion; `H` becomes the information (6 x
    6) at the minimum, the inverse of the covariance.
    """
    m = H.shape[0]
    g = np.empty(m)
    L = np.empty((m, m))
    xi = np.empty(m)
    for step in range(1, 31):
        normal_equations(Y, y, T, H, g)
        if len(Y0) > 0:
            relative_tangent(T, T0, xi)
            for i in range(m):
                for j in range(m):
                    H[i, j] += Y0[i, j]
                    g[i] -= Y0[i, j] * xi[j]
        for i in range(m):
            for j in range(m):
                L[i, j] = H[i, j]
        if not cholesky_solve(L, g, xi):
            return 0
        compose_tangent(T, xi)
        progress = 0.0
        for i in range(m):
            progress += xi[i] * g[i]
        if not progress < np.inf:
            return 0
        if progress < 1e-16:  # the squared step, in standard deviations
            return step
    return 30


@compiled
def assess(q: Array, W: Array, g: Array, H: Array, covariance: Array, numbers: Array) -> bool:
    """Set `covariance` (6 x 6) to the inverse of `H` and judge the geometry of the pairs with `g` > 0.

    `numbers` becomes (reciprocal condition number of H about the centroid with rotations scaled by the points'
    spread, second eigenvalue of the points' scatter in units of their noise variance, that eigenvalue relative to the
    first). False if singular.
    """
    m = H.shape[0]
    e = np.zeros(m)
    L = H.copy()
    if not cholesky(L):
        return False
    for k in range(m):
        e[k] = 1.0
        substitute(L, e, covariance[k])
        e[k] = 0.0
    used = total = 0.0
    mx = my = mz = 0.0
    xx = xy = xz = yy = yz = zz = 0.0
    a, b, c = q[0, 0], q[0, 1], q[0, 2]  # sums are about the first point: no digits are lost
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
    S = np.empty((3, 3))
    S[0, 0], S[1, 1], S[2, 2] = xx - total * mx * mx, yy - total * my * my, zz - total * mz * mz
    S[0, 1] = S[1, 0] = xy - total * mx * my
    S[0, 2] = S[2, 0] = xz - total * mx * mz
    S[1, 2] = S[2, 1] = yz - total * my * mz
    mx, my, mz = mx + a, my + b, mz + c
    spread = np.sqrt((S[0, 0] + S[1, 1] + S[2, 2]) / total)
    none = np.empty((0, 0))
    jacobi(S, none)
    a, b, c = S[0, 0], S[1, 1], S[2, 2]
    largest = max(a, max(b, c))
    second = a + b + c - largest - min(a, min(b, c))
    numbers[1] = second / used
    numbers[2] = second / largest if largest > 0.0 else 0.0
    # rotation about the centroid, arc length as the unit: xi = [I, hat(mean)/spread; 0, I/spread] xi'
    B = np.eye(m)
    s = 1.0 / spread
    for i in range(3):
        B[3 + i, 3 + i] = s
    B[0, 4], B[0, 5] = -s * mz, s * my
    B[1, 3], B[1, 5] = s * mz, -s * mx
    B[2, 3], B[2, 4] = -s * my, s * mx
    C = np.zeros((m, m))
    for i in range(m):
        for j in range(m):
            L[i, j] = 0.0
            for k in range(m):
                L[i, j] += H[i, k] * B[k, j]
    for i in range(m):
        for j in range(m):
            for k in range(m):
                C[i, j] += B[k, i] * L[k, j]
    jacobi(C, none)
    low = high = C[0, 0]
    for i in range(m):
        low, high = min(low, C[i, i]), max(high, C[i, i])
    numbers[0] = max(low, 0.0) / high
    return True
