"""Which surface each pixel sees, and how far it is: parallelograms filled row by row, the nearest kept.

A surface is `origin + s u + t v` with s, t in [0, 1], visible to whoever looks along `cross(u, v)`, who sees u to the
right and v downwards. Both inverse depth and depth-divided texture coordinates are affine over the image, so a surface
is filled without a division.
"""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled

Array = NDArray[np.float64]

NEAR_M = 0.05
"""What is nearer than this plane is cut off."""


@compiled
def project_surfaces(
    origin: Array, u: Array, v: Array, two_sided: NDArray[np.bool_], T_camera_world: Array, K: Array, out: Array
) -> None:
    """Fill `out` (n x 12): inverse depth a x + b y + c, then S and T (3 each) and their origins s0, t0.

    `K` is (fx, fy, cx, cy). A surface that shows its back has `out[i, 11] = 0`.
    """
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
def rasterise(
    origin: Array,
    u: Array,
    v: Array,
    coefficients: Array,
    T_camera_world: Array,
    K: Array,
    inverse_depth: NDArray[np.float32],
    identity: NDArray[np.int16],
) -> None:
    """Fill `inverse_depth` (H x W, 1/m along the optical axis, 0 for nothing) and the number of the surface seen."""
    height, width = inverse_depth.shape
    inverse_depth[:] = np.float32(0)
    identity[:] = np.int16(-1)
    R = T_camera_world
    corner = np.empty((4, 3))
    clipped = np.empty((8, 3))
    px = np.empty(8)
    py = np.empty(8)
    left = np.empty(height)
    right = np.empty(height)
    for i in range(origin.shape[0]):
        if coefficients[i, 11] == 0.0:
            continue
        behind = 0
        for k in range(4):
            ku = 1.0 if k == 1 or k == 2 else 0.0
            kv = 1.0 if k >= 2 else 0.0
            x = origin[i, 0] + ku * u[i, 0] + kv * v[i, 0]
            y = origin[i, 1] + ku * u[i, 1] + kv * v[i, 1]
            z = origin[i, 2] + ku * u[i, 2] + kv * v[i, 2]
            for r in range(3):
                corner[k, r] = R[r, 0] * x + R[r, 1] * y + R[r, 2] * z + R[r, 3]
            if corner[k, 2] < NEAR_M:
                behind += 1
        if behind == 4:
            continue
        n = 0
        for k in range(4):
            j = (k + 1) % 4
            zk, zj = corner[k, 2], corner[j, 2]
            if zk >= NEAR_M:
                for r in range(3):
                    clipped[n, r] = corner[k, r]
                n += 1
            if (zk >= NEAR_M) != (zj >= NEAR_M):
                f = (NEAR_M - zk) / (zj - zk)
                for r in range(3):
                    clipped[n, r] = corner[k, r] + f * (corner[j, r] - corner[k, r])
                n += 1
        x_min, x_max, y_min, y_max = 1e30, -1e30, 1e30, -1e30
        for k in range(n):
            px[k] = K[0] * clipped[k, 0] / clipped[k, 2] + K[2]
            py[k] = K[1] * clipped[k, 1] / clipped[k, 2] + K[3]
            x_min, x_max = min(x_min, px[k]), max(x_max, px[k])
            y_min, y_max = min(y_min, py[k]), max(y_max, py[k])
        if x_max < 0.0 or y_max < 0.0 or x_min > width - 1 or y_min > height - 1:
            continue
        row0 = int(np.ceil(max(y_min, 0.0)))
        row1 = int(np.floor(min(y_max, height - 1.0)))
        for y in range(row0, row1 + 1):
            left[y] = 1e30
            right[y] = -1e30
        for k in range(n):
            j = (k + 1) % n
            ya, yb, xa, xb = py[k], py[j], px[k], px[j]
            if ya > yb:
                ya, yb, xa, xb = yb, ya, xb, xa
            if yb - ya < 1e-12:
                continue
            slope = (xb - xa) / (yb - ya)
            first = int(np.ceil(max(ya, 0.0)))
            last = int(np.floor(min(yb, height - 1.0)))
            for y in range(first, last + 1):
                x = xa + slope * (y - ya)
                left[y] = min(left[y], x)
                right[y] = max(right[y], x)
        a = np.float32(coefficients[i, 0])
        for y in range(row0, row1 + 1):
            x0 = int(np.ceil(max(left[y], 0.0)))
            x1 = int(np.floor(min(right[y], width - 1.0))) + 1
            if x1 <= x0:
                continue
            base = np.float32(coefficients[i, 1] * y + coefficients[i, 2] + coefficients[i, 0] * x0)
            fill_span(inverse_depth[y, x0:x1], identity[y, x0:x1], a, base, np.int16(i))


@compiled
def fill_span(
    inverse_depth: NDArray[np.float32], identity: NDArray[np.int16], slope: np.float32, base: np.float32, i: np.int16
) -> None:
    """Keep the nearer of what is there and surface `i`, whose inverse depth is `base + slope k`."""
    for k in range(inverse_depth.shape[0]):
        w = base + slope * np.float32(k)
        nearer = w > inverse_depth[k]
        inverse_depth[k] = w if nearer else inverse_depth[k]
        identity[k] = i if nearer else identity[k]
