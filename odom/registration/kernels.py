"""Compiled loops over point pairs: precisions, residuals, the information recursion and its weighted projection.

Packed forms: a precision or covariance of a pair is its 6 unique entries (xx xy xz yy yz zz); the information of the
12-state x = vec[R | t] (row by row) is A (6 x 10: precision entry by unique entry of `h h'`, h = [q 1]), y (12) and
c, which hold `sum (p - Xh)' W (p - Xh) = x'Y x - 2 y'x + c` exactly, for any n.
"""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled

Array = NDArray[np.float64]

_ROW = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
_OUTER = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])


@compiled
def precisions(Sq: Array, Sp: Array, R: Array, alpha: float, W: Array) -> int:
    """Fill `W` (n x 8) with inv(S_k), a scalar weight 3 / tr S_k and log det S_k / 2, where `S_k = Sp + R Sq R'`.

    `alpha` > 0 replaces the second moment by the norm-bounded form `S_k = Sp + alpha tr(Sq) I`. `Sq` and `Sp`
    (n x 3 x 3) may be of length 0 for none. Returns the index of the first pair whose S_k is not positive, or -1.
    """
    n = len(W)
    r00, r01, r02 = R[0, 0], R[0, 1], R[0, 2]
    r10, r11, r12 = R[1, 0], R[1, 1], R[1, 2]
    r20, r21, r22 = R[2, 0], R[2, 1], R[2, 2]
    for k in range(n):
        a = b = c = d = e = f = 0.0
        if len(Sp) > 0:
            P = Sp[k]
            a, b, c, d, e, f = P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2]
            if not (a >= 0.0 and d >= 0.0 and f >= 0.0):
                return k
        if len(Sq) > 0:
            Q = Sq[k]
            q00, q01, q02, q11, q12, q22 = Q[0, 0], Q[0, 1], Q[0, 2], Q[1, 1], Q[1, 2], Q[2, 2]
            if not (q00 >= 0.0 and q11 >= 0.0 and q22 >= 0.0):
                return k
            if alpha > 0.0:
                s = alpha * (q00 + q11 + q22)
                a += s
                d += s
                f += s
            else:
                x0 = r00 * q00 + r01 * q01 + r02 * q02
                x1 = r00 * q01 + r01 * q11 + r02 * q12
                x2 = r00 * q02 + r01 * q12 + r02 * q22
                y0 = r10 * q00 + r11 * q01 + r12 * q02
                y1 = r10 * q01 + r11 * q11 + r12 * q12
                y2 = r10 * q02 + r11 * q12 + r12 * q22
                z0 = r20 * q00 + r21 * q01 + r22 * q02
                z1 = r20 * q01 + r21 * q11 + r22 * q12
                z2 = r20 * q02 + r21 * q12 + r22 * q22
                a += x0 * r00 + x1 * r01 + x2 * r02
                b += x0 * r10 + x1 * r11 + x2 * r12
                c += x0 * r20 + x1 * r21 + x2 * r22
                d += y0 * r10 + y1 * r11 + y2 * r12
                e += y0 * r20 + y1 * r21 + y2 * r22
                f += z0 * r20 + z1 * r21 + z2 * r22
        i00 = d * f - e * e
        i01 = c * e - b * f
        i02 = b * e - c * d
        det = a * i00 + b * i01 + c * i02
        minor = a * d - b * b
        if not (a > 0.0 and minor > 0.0 and det > 1e-12 * a * d * f and det < np.inf):
            return k
        s = 1.0 / det
        W[k, 0] = s * i00
        W[k, 1] = s * i01
        W[k, 2] = s * i02
        W[k, 3] = s * (a * f - c * c)
        W[k, 4] = s * (b * c - a * e)
        W[k, 5] = s * minor
        W[k, 6] = 3.0 / (a + d + f)
        W[k, 7] = 0.5 * np.log(det)
    return -1


@compiled
def mahalanobis(q: Array, p: Array, W: Array, T: Array, chi2: Array) -> float:
    """Fill `chi2` (n) with the squared residuals under `T`, each against its precision; return the largest."""
    largest = 0.0
    for k in range(len(q)):
        x, y, z = q[k, 0], q[k, 1], q[k, 2]
        u = p[k, 0] - (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3])  # eq. (1)
        v = p[k, 1] - (T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3])
        w = p[k, 2] - (T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3])
        e = (
            u * (W[k, 0] * u + 2.0 * (W[k, 1] * v + W[k, 2] * w))
            + v * (W[k, 3] * v + 2.0 * W[k, 4] * w)
            + W[k, 5] * w * w
        )
        chi2[k] = e
        if not e <= largest:
            largest = e
    return largest


@compiled
def accumulate(q: Array, p: Array, W: Array, g: Array, A: Array, y: Array) -> float:
    """Add the information of the pairs, each times `g[k]`, to `A` (6 x 10) and `y` (12); return sum p' W p.

    The information form of the filter without process noise: `Y += H' inv(S) H`, `Y x += H' inv(S) p`.
    """
    c = 0.0
    h = np.empty(10)
    for k in range(len(q)):
        s = g[k]
        if s <= 0.0:
            continue
        x, r, z = q[k, 0], q[k, 1], q[k, 2]
        h[0], h[1], h[2], h[3] = x * x, x * r, x * z, x
        h[4], h[5], h[6] = r * r, r * z, r
        h[7], h[8], h[9] = z * z, z, 1.0
        for i in range(6):
            w = s * W[k, i]
            if w != 0.0:  # a diagonal covariance leaves three rows out
                for j in range(10):
                    A[i, j] += w * h[j]
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
        c += b0 * u + b1 * v + b2 * w
    return c


@compiled
def unpack(A: Array, Y: Array) -> None:
    """Set `Y` (12 x 12) to the information matrix of vec[R | t] that `A` (6 x 10) holds."""
    row = _ROW
    outer = _OUTER
    for i in range(12):
        for j in range(12):
            Y[i, j] = A[row[i // 4, j // 4], outer[i % 4, j % 4]]
