"""Which surface each pixel sees, and how far it is: parallelograms filled row by row, the nearest kept.

A surface is `origin + s u + t v` with s, t in [0, 1]. It is visible to a camera that looks along `cross(u, v)`; u then
points to the right and v down. Inverse depth and texture coordinates over depth are affine over the image, so that a
surface is filled without a division.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from odom.geometry.arrays import Array, Mask
from odom.geometry.compiled import compiled
from sensors.arena.array_types import Float32, Identity

NEAR_M = 0.05
"""What is nearer than this plane is cut off: smaller, and the division by depth loses digits."""


class Surfaces(NamedTuple):
    """The geometry of a scene: n parallelograms in the world frame, metres; `patch` is each one's texture in the atlas.

    `infrared` is the share of near infrared light that comes back (0: glass or a black screen, no depth).
    """

    origin: Array
    u: Array
    v: Array
    two_sided: Mask
    infrared: Float32
    patch: NDArray[np.int32]


@compiled
def project_surfaces(surfaces: Surfaces, T_camera_world: Array, K: Array, out: Array) -> None:
    """Fill `out` (n x 12): inverse depth a x + b y + c, then S and T (3 each) and their origins s0, t0.

    `K` is (fx, fy, cx, cy). A surface that shows its back has `out[i, 11] = 0`.
    """
    origin, u, v, two_sided = surfaces.origin, surfaces.u, surfaces.v, surfaces.two_sided
    fx, fy, cx, cy = K[0], K[1], K[2], K[3]
    R = T_camera_world
    p = np.empty(3)
    a = np.empty(3)
    b = np.empty(3)
    for i in range(origin.shape[0]):
        for r in range(3):
            p[r] = R[r, 0] * origin[i, 0] + R[r, 1] * origin[i, 1] + R[r, 2] * origin[i, 2] + R[r, 3]
            a[r] = R[r, 0] * u[i, 0] + R[r, 1] * u[i, 1] + R[r, 2] * u[i, 2]
            b[r] = R[r, 0] * v[i, 0] + R[r, 1] * v[i, 1] + R[r, 2] * v[i, 2]
        nx = a[1] * b[2] - a[2] * b[1]
        ny = a[2] * b[0] - a[0] * b[2]
        nz = a[0] * b[1] - a[1] * b[0]
        d = nx * p[0] + ny * p[1] + nz * p[2]
        out[i, 11] = 0.0
        if d <= 1e-9 and not (two_sided[i] and d < -1e-9):
            continue
        out[i, 11] = 1.0
        wx, wy = nx / (d * fx), ny / (d * fy)
        out[i, 0], out[i, 1], out[i, 2] = wx, wy, nz / d - wx * cx - wy * cy
        aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
        bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
        ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        det = aa * bb - ab * ab
        for j in range(2):
            m0 = (bb if j == 0 else -ab) / det
            m1 = (-ab if j == 0 else aa) / det
            dx, dy, dz = m0 * a[0] + m1 * b[0], m0 * a[1] + m1 * b[1], m0 * a[2] + m1 * b[2]
            out[i, 3 + 3 * j] = dx / fx
            out[i, 4 + 3 * j] = dy / fy
            out[i, 5 + 3 * j] = dz - dx / fx * cx - dy / fy * cy
            out[i, 9 + j] = dx * p[0] + dy * p[1] + dz * p[2]


@compiled
def _clip(corner: Array, clipped: Array) -> int:
    """Copy the polygon of 4 corners (camera frame) beyond NEAR_M to `clipped`; return how many corners it has."""
    n = 0
    for k in range(4):
        j = (k + 1) % 4
        zk, zj = corner[k, 2], corner[j, 2]
        if zk >= NEAR_M:
            clipped[n] = corner[k]
            n += 1
        if (zk >= NEAR_M) != (zj >= NEAR_M):
            f = (NEAR_M - zk) / (zj - zk)
            for r in range(3):
                clipped[n, r] = corner[k, r] + f * (corner[j, r] - corner[k, r])
            n += 1
    return n


@compiled
def _find_edges(x: Array, y: Array, n: int, left: Array, right: Array) -> None:
    """Widen `left` and `right` (column of each row) to the edges of the polygon with n corners at (x, y) pixels."""
    for k in range(n):
        j = (k + 1) % n
        ya, yb, xa, xb = y[k], y[j], x[k], x[j]
        if ya > yb:
            ya, yb, xa, xb = yb, ya, xb, xa
        if yb - ya < 1e-12:
            continue
        slope = (xb - xa) / (yb - ya)
        first = int(np.ceil(max(ya, 0.0)))
        last = int(np.floor(min(yb, left.shape[0] - 1.0)))
        for row in range(first, last + 1):
            column = xa + slope * (row - ya)
            left[row] = min(left[row], column)
            right[row] = max(right[row], column)


@compiled
def rasterise(
    surfaces: Surfaces, coefficients: Array, T_camera_world: Array, K: Array, inverse_depth: Float32, identity: Identity
) -> None:
    """Fill `inverse_depth` (H x W, 1/m along the optical axis, 0 for nothing) and the number of the surface seen.

    `coefficients` is what `project_surfaces` filled. Each surface is clipped at NEAR_M, its corners are projected, and
    every row between its edges is filled where the surface is nearer than what is there.
    """
    origin, u, v = surfaces.origin, surfaces.u, surfaces.v
    height, width = inverse_depth.shape
    inverse_depth[:] = np.float32(0)
    identity[:] = np.int16(-1)
    R = T_camera_world
    corner, clipped = np.empty((4, 3)), np.empty((8, 3))
    px, py = np.empty(8), np.empty(8)
    left, right = np.empty(height), np.empty(height)
    for i in range(origin.shape[0]):
        if coefficients[i, 11] == 0.0:
            continue
        for k in range(4):
            ku = 1.0 if k == 1 or k == 2 else 0.0
            kv = 1.0 if k >= 2 else 0.0
            x = origin[i, 0] + ku * u[i, 0] + kv * v[i, 0]
            y = origin[i, 1] + ku * u[i, 1] + kv * v[i, 1]
            z = origin[i, 2] + ku * u[i, 2] + kv * v[i, 2]
            for r in range(3):
                corner[k, r] = R[r, 0] * x + R[r, 1] * y + R[r, 2] * z + R[r, 3]
        n = _clip(corner, clipped)
        x_min, x_max, y_min, y_max = 1e30, -1e30, 1e30, -1e30
        for k in range(n):
            px[k] = K[0] * clipped[k, 0] / clipped[k, 2] + K[2]
            py[k] = K[1] * clipped[k, 1] / clipped[k, 2] + K[3]
            x_min, x_max = min(x_min, px[k]), max(x_max, px[k])
            y_min, y_max = min(y_min, py[k]), max(y_max, py[k])
        if n == 0 or x_max < 0.0 or y_max < 0.0 or x_min > width - 1 or y_min > height - 1:
            continue
        row0, row1 = int(np.ceil(max(y_min, 0.0))), int(np.floor(min(y_max, height - 1.0)))
        left[row0 : row1 + 1] = 1e30
        right[row0 : row1 + 1] = -1e30
        _find_edges(px, py, n, left, right)
        a = np.float32(coefficients[i, 0])
        for y in range(row0, row1 + 1):
            x0 = int(np.ceil(max(left[y], 0.0)))
            x1 = int(np.floor(min(right[y], width - 1.0))) + 1
            if x1 > x0:
                base = np.float32(coefficients[i, 1] * y + coefficients[i, 2] + coefficients[i, 0] * x0)
                fill_span(inverse_depth[y, x0:x1], identity[y, x0:x1], a, base, np.int16(i))


@compiled
def fill_span(inverse_depth: Float32, identity: Identity, slope: np.float32, base: np.float32, i: np.int16) -> None:
    """Keep the nearer of what is there and surface `i`, whose inverse depth is `base + slope k`."""
    for k in range(inverse_depth.shape[0]):
        w = base + slope * np.float32(k)
        nearer = w > inverse_depth[k]
        inverse_depth[k] = w if nearer else inverse_depth[k]
        identity[k] = i if nearer else identity[k]
