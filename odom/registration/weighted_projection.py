"""The projection of the twelve states onto SE(3), weighted by their information.

It minimises `(x - vec T)' Y (x - vec T)` over rigid motions T = [R | t], where the nearest rotation by SVD would weigh
all entries alike: that costs a factor of two in accuracy, this reaches the Cramer-Rao bound. With `B = d vec T / d xi`
(`tangent_basis`) the information of the motion is `H = B'Y B`.
"""

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from odom.geometry.compiled_se3 import compose_tangent, inverse_right_jacobian, product, relative_tangent
from odom.registration.linear_algebra import cholesky_solve


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
def add_prior(Y0: Array, T0: Array, T: Array, H: Array, g: Array) -> None:
    """Add to `H` and `g` one more measurement of the motion: xi = log(inv(T0) T) is 0 with information `Y0` (6 x 6).

    With `J = d xi / d(rho, phi)` at `T @ exp(rho, phi)` these are `J'Y0 J` and `-J'Y0 xi`.
    """
    m = len(Y0)
    xi, J, YJ = np.empty(m), np.empty((m, m)), np.zeros((m, m))
    relative_tangent(T, T0, xi)
    inverse_right_jacobian(xi, J)
    product(Y0, J, YJ)
    for i in range(m):
        for k in range(m):
            g[i] -= YJ[k, i] * xi[k]
            for j in range(m):
                H[i, j] += J[k, i] * YJ[k, j]


@compiled
def project_onto_se3(Y: Array, y: Array, Y0: Array, T0: Array, T: Array, H: Array) -> int:
    """Move `T` to the minimum over SE(3) of `x'Yx - 2 y'x`, plus a prior of information `Y0` (6 x 6 or empty).

    The prior lies at `T0`. Y (12 x 12) need not be regular (points in a plane): `B'Y B` is enough. Returns the number
    of Gauss-Newton steps, or 0 when the information does not determine the motion; `H` becomes the information (6 x
    6) at the minimum, the inverse of the covariance.
    """
    m = H.shape[0]
    g = np.empty(m)
    L = np.empty((m, m))
    xi = np.empty(m)
    for step in range(1, 31):  # Gauss-Newton; three to six steps are the rule
        normal_equations(Y, y, T, H, g)
        if len(Y0) > 0:
            add_prior(Y0, T0, T, H, g)
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
