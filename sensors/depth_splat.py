"""Draws each pixel of a depth image as a small square into another camera's image."""

import numpy as np
from numpy.typing import NDArray

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

OVERLAP = 0.15
"""Pixels by which neighbours overlap, since on a slanted surface their common edge is projected with two depths.

Less leaves gaps in slanted surfaces, more widens near things.
"""


@compiled
def _project(
    depth: float, ray: Array, shift: Array, k: tuple[float, float, float, float], d: Array
) -> tuple[float, float]:
    """Return the pixel of the point at `depth` on a ray from `shift`.

    `d` is OpenCV's k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 (without the tilted sensor).
    """
    z = depth * ray[2] + shift[2]
    a, b = (depth * ray[0] + shift[0]) / z, (depth * ray[1] + shift[1]) / z
    r = a * a + b * b
    radial = (1 + r * (d[0] + r * (d[1] + r * d[4]))) / (1 + r * (d[5] + r * (d[6] + r * d[7])))
    u = a * radial + 2 * d[2] * a * b + d[3] * (r + 2 * a * a) + d[8] * r + d[9] * r * r
    v = b * radial + d[2] * (r + 2 * b * b) + 2 * d[3] * a * b + d[10] * r + d[11] * r * r
    return k[0] * u + k[2], k[1] * v + k[3]


@compiled
def splat(
    depth: NDArray[np.uint16],
    rays: Array,
    shift: Array,
    k: tuple[float, float, float, float],
    d: Array,
    out: NDArray[np.uint16],
) -> None:
    """Lower `out` (uint16, mm) to the depth of every pixel of `depth` (H x W uint16, mm) that covers its pixels.

    `rays` are the directions of the corners of the depth pixels ((H + 1) x (W + 1) x 3) in the axes of the camera of
    `out`, `shift` the depth camera's place there (mm); `k` and `d` are its intrinsics and distortion (see `_project`).
    """
    height, width = out.shape
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            z = float(depth[row, column])
            if z == 0:
                continue
            near = z * rays[row, column, 2] + shift[2]
            far = z * rays[row + 1, column + 1, 2] + shift[2]
            if near <= 0 or far <= 0:
                continue
            ua, va = _project(z, rays[row, column], shift, k, d)
            ub, vb = _project(z, rays[row, column + 1], shift, k, d)
            uc, vc = _project(z, rays[row + 1, column + 1], shift, k, d)
            ud, vd = ua + uc - ub, va + vc - vb  # so small a square stays a parallelogram
            u0, u1 = min(min(ua, ub), min(uc, ud)), max(max(ua, ub), max(uc, ud))
            v0, v1 = min(min(va, vb), min(vc, vd)), max(max(va, vb), max(vc, vd))
            if not (u1 > -1 and u0 < width and v1 > -1 and v0 < height):
                continue
            value = 0.5 * (near + far) + 0.5
            if value >= 65535:
                continue
            for v in range(max(0, int(np.ceil(v0 - OVERLAP))), min(height, int(np.ceil(v1 + OVERLAP)))):
                for u in range(max(0, int(np.ceil(u0 - OVERLAP))), min(width, int(np.ceil(u1 + OVERLAP)))):
                    if value < out[v, u]:
                        out[v, u] = np.uint16(value)
