"""Algebra of small symmetric matrices in compiled loops, without a library call.

G. Golub and C. Van Loan, "Matrix Computations", chapters 4.2 (Cholesky) and 8.5 (Jacobi). Tolerances are relative to
the matrix and stand for rounding: what is below them is 0.
"""

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled


@compiled
def cholesky(H: Array) -> bool:
    """Replace the lower triangle of `H` by the factor L of `H = L L'`; False when `H` is not positive definite."""
    m = len(H)
    for j in range(m):
        d = H[j, j]
        for k in range(j):
            d -= H[j, k] * H[j, k]
        if not d > 1e-14 * H[j, j]:
            return False
        d = np.sqrt(d)
        H[j, j] = d
        for i in range(j + 1, m):
            s = H[i, j]
            for k in range(j):
                s -= H[i, k] * H[j, k]
            H[i, j] = s / d
    return True


@compiled
def substitute(L: Array, g: Array, x: Array) -> None:
    """Solve `L L' x = g` for a Cholesky factor `L`."""
    m = len(L)
    for i in range(m):
        s = g[i]
        for k in range(i):
            s -= L[i, k] * x[k]
        x[i] = s / L[i, i]
    for i in range(m - 1, -1, -1):
        s = x[i]
        for k in range(i + 1, m):
            s -= L[k, i] * x[k]
        x[i] = s / L[i, i]


@compiled
def cholesky_solve(H: Array, g: Array, x: Array) -> bool:
    """Solve `H x = g`, overwriting the lower triangle of `H`; False when `H` is not positive definite."""
    if not cholesky(H):
        return False
    substitute(H, g, x)
    return True


@compiled
def jacobi(N: Array, V: Array) -> None:
    """Diagonalise the symmetric matrix `N` in place; the columns of `V` (I, or empty) become its eigenvectors."""
    m = len(N)
    for _ in range(30):  # sweeps; convergence is quadratic
        off = 0.0
        diagonal = 0.0
        for i in range(m):
            diagonal += N[i, i] * N[i, i]
            for j in range(i + 1, m):
                off += N[i, j] * N[i, j]
        if not off > 1e-30 * diagonal:
            return
        for i in range(m - 1):
            for j in range(i + 1, m):
                if N[i, j] == 0.0:
                    continue
                # the rotation by c, s in the plane i, j that makes N[i, j] zero, applied from both sides
                theta = (N[j, j] - N[i, i]) / (2.0 * N[i, j])
                t = 1.0 / (np.abs(theta) + np.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                for k in range(m):
                    x, y = N[k, i], N[k, j]
                    N[k, i] = c * x - s * y
                    N[k, j] = s * x + c * y
                for k in range(m):
                    x, y = N[i, k], N[j, k]
                    N[i, k] = c * x - s * y
                    N[j, k] = s * x + c * y
                for k in range(len(V)):
                    x, y = V[k, i], V[k, j]
                    V[k, i] = c * x - s * y
                    V[k, j] = s * x + c * y
