"""The noise of a pair: its precision (inverse covariance) and its residual in units of that noise.

`W` (n x 8) holds for each pair the six entries xx xy xz yy yz zz of inv(S_k), a scalar weight and log det S_k / 2.
"""

import numpy as np

from odom.errors import InputError
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled


def bad_covariance(k: int) -> InputError:
    """Return the error that names the pair whose covariance cannot be used."""
    return InputError(f"the covariance of pair {k} is not positive definite: leave it out, or add the pixel's noise")


@compiled
def precisions(Sq: Array, Sp: Array, R: Array, alpha: float, W: Array) -> int:
    """Fill `W` from `S_k = Sp + R Sq R'`, the exact second moment of p - R q under the noise of both points.

    The source's part is what eq. (25) is for, the uncertainty dH of C; there it holds q + sigma, corrected here to the
    noise alone. `alpha` > 0 takes the norm-bounded form instead (eqs. 26-27): `S_k = Sp + alpha tr(Sq) I`, with
    M_2k = sqrt(alpha) I and N_k = I3 (x) sqrt(Sq). Returns the index of the first pair whose S_k is not positive
    definite, or -1.
    """
    n = len(W)
    r00, r01, r02 = R[0, 0], R[0, 1], R[0, 2]
    r10, r11, r12 = R[1, 0], R[1, 1], R[1, 2]
    r20, r21, r22 = R[2, 0], R[2, 1], R[2, 2]
    for k in range(n):
        # S_k = [a b c; b d e; c e f], at first Sp
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
            else:  # rows x, y, z of R Sq, then their products with the rows of R
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
        # inv(S_k) by cofactors; positive definite if all leading minors are (Sylvester), the last beyond rounding
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
        W[k, 6] = 3.0 / (a + d + f)  # the weight 3 / tr S_k for Horn's closed form
        W[k, 7] = 0.5 * np.log(det)
    return -1


@compiled
def mahalanobis(q: Array, p: Array, W: Array, T: Array, chi2: Array) -> None:
    """Fill `chi2` (n) with `e' inv(S_k) e` of the residuals `e = p - (R q + t)`, eq. (1)."""
    for k in range(len(q)):
        x, y, z = q[k, 0], q[k, 1], q[k, 2]
        u = p[k, 0] - (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3])
        v = p[k, 1] - (T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3])
        w = p[k, 2] - (T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3])
        chi2[k] = (
            u * (W[k, 0] * u + 2.0 * (W[k, 1] * v + W[k, 2] * w))
            + v * (W[k, 3] * v + 2.0 * W[k, 4] * w)
            + W[k, 5] * w * w
        )
