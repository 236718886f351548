"""Horn's closed form over weighted pairs, as a compiled loop: B. Horn, J. Opt. Soc. Am. A 4, 1987."""

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from odom.registration.linear_algebra import jacobi


@compiled
def rotation_of(M: Array, T: Array) -> None:
    """Set `T[:3, :3]` to the rotation R of largest trace(R M), `M` 3 x 3, by its quaternion (Horn, section 4)."""
    # the symmetric matrix whose eigenvector of the largest eigenvalue is the quaternion (w x y z)
    N = np.empty((4, 4))
    N[0, 0] = M[0, 0] + M[1, 1] + M[2, 2]
    N[1, 1] = M[0, 0] - M[1, 1] - M[2, 2]
    N[2, 2] = M[1, 1] - M[0, 0] - M[2, 2]
    N[3, 3] = M[2, 2] - M[0, 0] - M[1, 1]
    N[0, 1] = N[1, 0] = M[1, 2] - M[2, 1]
    N[0, 2] = N[2, 0] = M[2, 0] - M[0, 2]
    N[0, 3] = N[3, 0] = M[0, 1] - M[1, 0]
    N[1, 2] = N[2, 1] = M[0, 1] + M[1, 0]
    N[1, 3] = N[3, 1] = M[2, 0] + M[0, 2]
    N[2, 3] = N[3, 2] = M[1, 2] + M[2, 1]
    V = np.eye(4)
    jacobi(N, V)
    best = 0
    for j in range(1, 4):
        if N[j, j] > N[best, best]:
            best = j
    # the rotation of that quaternion
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
def weighted_horn(q: Array, p: Array, W: Array, g: Array, T: Array) -> float:
    """Set `T` (4 x 4) to Horn's closed form for scalar weights `g[k] W[k, 6]`; return the sum of the weights."""
    # sums of w, w q, w p and w q p'
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
    # M about the centroids, so that eq. (6) remains: R of largest trace(R M)
    i = 1.0 / total
    M = np.empty((3, 3))
    M[0, 0], M[0, 1], M[0, 2] = m00 - sq0 * sp0 * i, m01 - sq0 * sp1 * i, m02 - sq0 * sp2 * i
    M[1, 0], M[1, 1], M[1, 2] = m10 - sq1 * sp0 * i, m11 - sq1 * sp1 * i, m12 - sq1 * sp2 * i
    M[2, 0], M[2, 1], M[2, 2] = m20 - sq2 * sp0 * i, m21 - sq2 * sp1 * i, m22 - sq2 * sp2 * i
    rotation_of(M, T)
    # t = mean p - R mean q: eq. (4)
    T[0, 3] = (sp0 - T[0, 0] * sq0 - T[0, 1] * sq1 - T[0, 2] * sq2) * i
    T[1, 3] = (sp1 - T[1, 0] * sq0 - T[1, 1] * sq1 - T[1, 2] * sq2) * i
    T[2, 3] = (sp2 - T[2, 0] * sq0 - T[2, 1] * sq1 - T[2, 2] * sq2) * i
    T[3, 0] = T[3, 1] = T[3, 2] = 0.0
    T[3, 3] = 1.0
    return total
