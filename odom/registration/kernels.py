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
def jacobi(N: Array, V: Array) -> None:
    """Diagonalise the symmetric matrix `N` in place; the columns of `V` (identity, or empty) its eigenvectors."""
    m = len(N)
    for _ in range(30):
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


@compiled
def cholesky(H: Array) -> bool:
    """Replace the lower triangle of the positive matrix `H` by its Cholesky factor; False when it is not positive."""
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
    """Solve `H x = g` for a positive matrix `H`, whose lower triangle is overwritten; False when it is not."""
    if not cholesky(H):
        return False
    substitute(H, g, x)
    return True


@compiled
def unpack(A: Array, Y: Array) -> None:
    """Set `Y` (12 x 12) to the information matrix of vec[R | t] that `A` (6 x 10) holds."""
    row = _ROW
    outer = _OUTER
    for i in range(12):
        for j in range(12):
            Y[i, j] = A[row[i // 4, j // 4], outer[i % 4, j % 4]]


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
