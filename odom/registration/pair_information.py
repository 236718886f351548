"""The information of all pairs about the twelve states x = vec[R | t], summed."""

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

_ROW = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Which of the six entries of a symmetric 3 x 3 matrix stands at row i, column j."""
_OUTER = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])
"""Which of the ten entries of a symmetric 4 x 4 matrix stands at row i, column j."""


@compiled
def accumulate(q: Array, p: Array, W: Array, g: Array, A: Array, y: Array) -> None:
    """Add `g[k] C'inv(S_k) C` of each pair to `A` and `g[k] C'inv(S_k) p` to `y`: eqs. (14)-(16) as information.

    `C = I3 (x) h'` with h = [q 1] is eq. (10)'s H extended by t, so `C'inv(S) C = inv(S) (x) h h'`: `A` (6 x 10) holds
    the entries of inv(S) times those of h h', 60 numbers instead of 144; `information_matrix` makes the matrix of them.
    """
    h = np.empty(10)
    for k in range(len(q)):
        s = g[k]
        if s <= 0.0:
            continue
        # h h', upper triangle
        x, r, z = q[k, 0], q[k, 1], q[k, 2]
        h[0], h[1], h[2], h[3] = x * x, x * r, x * z, x
        h[4], h[5], h[6] = r * r, r * z, r
        h[7], h[8], h[9] = z * z, z, 1.0
        for i in range(6):
            w = s * W[k, i]
            if w != 0.0:  # a diagonal covariance leaves three rows out
                for j in range(10):
                    A[i, j] += w * h[j]
        # b = inv(S) p; y += b (x) h
        u, v, w = p[k, 0], p[k, 1], p[k, 2]
        b0 = s * (W[k, 0] * u + W[k, 1] * v + W[k, 2] * w)
        b1 = s * (W[k, 1] * u + W[k, 3] * v + W[k, 4] * w)
        b2 = s * (W[k, 2] * u + W[k, 4] * v + W[k, 5] * w)
        y[0] += b0 * x
        y[1] += b0 * r
        y[2] += b0 * z
        y[3] += b0
        y[4] += b1 * x
        y[5] += b1 * r
        y[6] += b1 * z
        y[7] += b1
        y[8] += b2 * x
        y[9] += b2 * r
        y[10] += b2 * z
        y[11] += b2


@compiled
def allow_for_source_noise(Sq: Array, R: Array, W: Array, g: Array, y: Array) -> None:
    """Add `g[k] inv(S_k) R Sq` of each pair to the entries of `y` (12) that belong to R: eqs. (14)-(16), corrected.

    They take C for known, but its h holds the source's noise: `sum C'inv(S) C` is too large by `sum inv(S) (x) Sq`,
    however many the pairs, and the motion turns to where that costs least (errors in variables: W. Fuller, "Measurement
    Error Models", 1987, chapter 2). `y` grows by that noise times the motion, near which `R` lies, instead of Y
    shrinking, which stays positive so. `Sq` of length 0: no noise.
    """
    for k in range(len(Sq)):
        s = g[k]
        if s <= 0.0:
            continue
        for j in range(3):
            u = s * (R[0, 0] * Sq[k, 0, j] + R[0, 1] * Sq[k, 1, j] + R[0, 2] * Sq[k, 2, j])
            v = s * (R[1, 0] * Sq[k, 0, j] + R[1, 1] * Sq[k, 1, j] + R[1, 2] * Sq[k, 2, j])
            w = s * (R[2, 0] * Sq[k, 0, j] + R[2, 1] * Sq[k, 1, j] + R[2, 2] * Sq[k, 2, j])
            y[j] += W[k, 0] * u + W[k, 1] * v + W[k, 2] * w
            y[4 + j] += W[k, 1] * u + W[k, 3] * v + W[k, 4] * w
            y[8 + j] += W[k, 2] * u + W[k, 4] * v + W[k, 5] * w


@compiled
def information_matrix(A: Array, Y: Array) -> None:
    """Set `Y` (12 x 12) to the information matrix that `A` (6 x 10) holds."""
    row = _ROW
    outer = _OUTER
    for i in range(12):
        for j in range(12):
            Y[i, j] = A[row[i // 4, j // 4], outer[i % 4, j % 4]]
