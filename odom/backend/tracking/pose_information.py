"""The robust information of many landmarks about a pose, computed a block at a time by vector instructions.

To the bit the same as what `robust_information` and `interaction_matrix` give for single ones, added up in order.
"""

import numpy as np

from odom.geometry.arrays import Array, Mask
from odom.geometry.compiled import compiled

NEAREST_M = 0.05
"""Nearer points count as behind the camera: no depth camera measures so near, and 1/z would run away."""
BEHIND_CAMERA_CHI2 = 1e9
"""Stands for a point behind the camera: far above any gate."""
_LANES = 64
"""Landmarks of a block: a constant, so that the compiler sees that the rows of a block do not overlap."""
_READ, _WRITTEN = 16 * _LANES, 9 * _LANES
"""How many numbers a block holds, and how many are computed from it."""


@compiled
def in_blocks(points: Array, covariances: Array, values: Array, variances: Array) -> Array:
    """Return n landmarks in blocks of 64, each with 16 rows of 64 numbers.

    `points` (n x 3, m), `covariances` (n x 3 x 3, m^2; upper triangle), `values` (n x 3) and `variances` (n x 4).
    """
    n = len(points)
    blocks = np.zeros((n + _LANES - 1) // _LANES * _READ)
    for k in range(n):
        at = k // _LANES * _READ + k % _LANES
        for i in range(3):
            blocks[at + i * _LANES] = points[k, i]
            blocks[at + (9 + i) * _LANES] = values[k, i]
            blocks[at + (12 + i) * _LANES] = variances[k, i]
        blocks[at + 15 * _LANES] = variances[k, 3]
        row = 3
        for i in range(3):
            for j in range(i, 3):
                blocks[at + row * _LANES] = covariances[k, i, j]
                row += 1
    return blocks


@compiled
def _fill_terms(T: Array, block: Array, cauchy: float, terms: Array) -> None:
    """Fill x/z, y/z, 1/z (0: behind), chi2 of ray and depth, I_xx, I_xy, I_yy and I_ww of a block's landmarks.

    With h the projection to (x/z, y/z, 1/z), R = dh/dp at the landmark p, and S = Sp + R Sq R'.
    """
    a0, a1, a2, a3 = T[0, 0], T[0, 1], T[0, 2], T[0, 3]
    b0, b1, b2, b3 = T[1, 0], T[1, 1], T[1, 2], T[1, 3]
    c0, c1, c2, c3 = T[2, 0], T[2, 1], T[2, 2], T[2, 3]
    for k in range(_LANES):
        p0, p1, p2 = block[k], block[k + _LANES], block[k + 2 * _LANES]
        C00, C01, C02 = block[k + 3 * _LANES], block[k + 4 * _LANES], block[k + 5 * _LANES]
        C11, C12, C22 = block[k + 6 * _LANES], block[k + 7 * _LANES], block[k + 8 * _LANES]
        # h(T p), and the rows of R: x0 to x2, y0 to y2, w0 to w2
        Z = c0 * p0 + c1 * p1 + c2 * p2 + c3
        w = 1.0 / Z
        x, y = (a0 * p0 + a1 * p1 + a2 * p2 + a3) * w, (b0 * p0 + b1 * p1 + b2 * p2 + b3) * w
        x0, x1, x2 = w * (a0 - x * c0), w * (a1 - x * c1), w * (a2 - x * c2)
        y0, y1, y2 = w * (b0 - y * c0), w * (b1 - y * c1), w * (b2 - y * c2)
        w0, w1, w2 = -w * w * c0, -w * w * c1, -w * w * c2
        # S of the ray (sxx, sxy, syy) and of the depth (sww)
        u0, u1, u2 = C00 * x0 + C01 * x1 + C02 * x2, C01 * x0 + C11 * x1 + C12 * x2, C02 * x0 + C12 * x1 + C22 * x2
        v0, v1, v2 = C00 * y0 + C01 * y1 + C02 * y2, C01 * y0 + C11 * y1 + C12 * y2, C02 * y0 + C12 * y1 + C22 * y2
        z0, z1, z2 = C00 * w0 + C01 * w1 + C02 * w2, C01 * w0 + C11 * w1 + C12 * w2, C02 * w0 + C12 * w1 + C22 * w2
        sxx = block[k + 12 * _LANES] + (x0 * u0 + x1 * u1 + x2 * u2)
        sxy = block[k + 13 * _LANES] + (y0 * u0 + y1 * u1 + y2 * u2)
        syy = block[k + 14 * _LANES] + (y0 * v0 + y1 * v1 + y2 * v2)
        sww = block[k + 15 * _LANES] + (w0 * z0 + w1 * z1 + w2 * z2)
        # residual, chi2, and inv(S) times the Cauchy weight
        measured = block[k + 11 * _LANES]
        rx, ry, rw = block[k + 9 * _LANES] - x, block[k + 10 * _LANES] - y, measured - w
        inverse = 1.0 / (sxx * syy - sxy * sxy)
        ray = (syy * rx * rx - 2.0 * sxy * rx * ry + sxx * ry * ry) * inverse
        weight = inverse / (1.0 + ray / cauchy)
        depth = rw * rw / sww
        iww = 1.0 / (sww * (1.0 + depth / cauchy))
        terms[k] = x
        terms[k + _LANES] = y
        terms[k + 2 * _LANES] = 0.0 if Z < NEAREST_M else w
        terms[k + 3 * _LANES] = ray
        terms[k + 4 * _LANES] = depth if measured > 0.0 else 0.0
        terms[k + 5 * _LANES] = syy * weight
        terms[k + 6 * _LANES] = -sxy * weight
        terms[k + 7 * _LANES] = sxx * weight
        terms[k + 8 * _LANES] = iww if measured > 0.0 else 0.0


@compiled
def chi2_in_blocks(T: Array, blocks: Array, n: int) -> Array:
    """Return chi2 (n x 2: ray, depth) of n landmarks `in_blocks` at the pose `T`."""
    chi2, terms = np.zeros((n, 2)), np.zeros(_WRITTEN)
    for k in range(n):
        at = k % _LANES
        if at == 0:
            first = k // _LANES * _READ
            _fill_terms(T, blocks[first : first + _READ], 1.0, terms)
        if terms[at + 2 * _LANES] == 0.0:
            chi2[k, 0] = BEHIND_CAMERA_CHI2
        else:
            chi2[k, 0], chi2[k, 1] = terms[at + 3 * _LANES], terms[at + 4 * _LANES]
    return chi2


@compiled
def add_up(T: Array, blocks: Array, used: Mask, cauchy: float) -> tuple[Array, Array, Array]:
    """Return H = sum w J' inv(S) J (6 x 6), g = sum w J' inv(S) r (6) and chi2 (n x 2: ray, depth) at the pose `T`.

    Of n landmarks `in_blocks`, those that are `used` (n) are summed, with Cauchy weights w. J is `interaction_matrix`
    without its zeros: for x/z (w, 0, x2, x3, x4, -y), for y/z (0, w, y2, y3, y4, x), for 1/z (0, 0, w2, w3, w4, 0).
    Sums in single numbers are quicker than in arrays.
    """
    n = len(used)
    chi2, terms = np.zeros((n, 2)), np.zeros(_WRITTEN)
    g0 = g1 = g2 = g3 = g4 = g5 = 0.0
    h00 = h01 = h02 = h03 = h04 = h05 = h11 = h12 = h13 = h14 = h15 = 0.0
    h22 = h23 = h24 = h25 = h33 = h34 = h35 = h44 = h45 = h55 = 0.0
    for k in range(n):
        at = k % _LANES
        first = k // _LANES * _READ
        if at == 0:
            _fill_terms(T, blocks[first : first + _READ], cauchy, terms)
        if not used[k]:
            continue
        x, y, w = terms[at], terms[at + _LANES], terms[at + 2 * _LANES]
        if w == 0.0:
            chi2[k, 0] = BEHIND_CAMERA_CHI2
            continue
        chi2[k, 0], chi2[k, 1] = terms[at + 3 * _LANES], terms[at + 4 * _LANES]
        ixx, ixy, iyy = terms[at + 5 * _LANES], terms[at + 6 * _LANES], terms[at + 7 * _LANES]
        iww = terms[at + 8 * _LANES]
        at += first + 9 * _LANES
        rx, ry, rw = blocks[at] - x, blocks[at + _LANES] - y, blocks[at + 2 * _LANES] - w
        # row by row of H and g: (a0, a1) is the row of J' inv(S) for x/z and y/z
        x2, x3, x4 = -x * w, -x * y, 1.0 + x * x
        y2, y3, y4 = -y * w, -1.0 - y * y, x * y
        a0, a1 = ixx * w, ixy * w
        g0 += a0 * rx + a1 * ry
        h00 += a0 * w
        h01 += a1 * w
        h02 += a0 * x2 + a1 * y2
        h03 += a0 * x3 + a1 * y3
        h04 += a0 * x4 + a1 * y4
        h05 += a1 * x - a0 * y
        a0, a1 = ixy * w, iyy * w
        g1 += a0 * rx + a1 * ry
        h11 += a1 * w
        h12 += a0 * x2 + a1 * y2
        h13 += a0 * x3 + a1 * y3
        h14 += a0 * x4 + a1 * y4
        h15 += a1 * x - a0 * y
        a0, a1 = ixx * x2 + ixy * y2, ixy * x2 + iyy * y2
        g2 += a0 * rx + a1 * ry
        h22 += a0 * x2 + a1 * y2
        h23 += a0 * x3 + a1 * y3
        h24 += a0 * x4 + a1 * y4
        h25 += a1 * x - a0 * y
        a0, a1 = ixx * x3 + ixy * y3, ixy * x3 + iyy * y3
        g3 += a0 * rx + a1 * ry
        h33 += a0 * x3 + a1 * y3
        h34 += a0 * x4 + a1 * y4
        h35 += a1 * x - a0 * y
        a0, a1 = ixx * x4 + ixy * y4, ixy * x4 + iyy * y4
        g4 += a0 * rx + a1 * ry
        h44 += a0 * x4 + a1 * y4
        h45 += a1 * x - a0 * y
        a0, a1 = ixy * x - ixx * y, iyy * x - ixy * y
        g5 += a0 * rx + a1 * ry
        h55 += a1 * x - a0 * y
        if iww > 0.0:  # depth changes with the unknowns 2, 3 and 4 only
            w2, w3, w4 = -w * w, -y * w, x * w
            a2, a3, a4 = iww * w2, iww * w3, iww * w4
            g2 += a2 * rw
            g3 += a3 * rw
            g4 += a4 * rw
            h22 += a2 * w2
            h23 += a2 * w3
            h24 += a2 * w4
            h33 += a3 * w3
            h34 += a3 * w4
            h44 += a4 * w4
    upper = (h00, h01, h02, h03, h04, h05, h11, h12, h13, h14, h15, h22, h23, h24, h25, h33, h34, h35, h44, h45, h55)
    H, at = np.zeros((6, 6)), 0
    for a in range(6):
        for b in range(a, 6):
            H[a, b] = H[b, a] = upper[at]
            at += 1
    return H, np.array((g0, g1, g2, g3, g4, g5)), chi2
