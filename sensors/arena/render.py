"""Draw textured parallelograms into a pinhole camera: which surface each pixel sees, how far, and in what colour.

A surface is `origin + s u + t v` with s, t in [0, 1], visible to whoever looks along `cross(u, v)`, who sees u to the
right and v downwards. Both inverse depth and depth-divided texture coordinates are affine over the image, so a surface
is filled row by row without a division; colour is looked up afterwards, once a sample, from mip-mapped textures.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from sensors.arena.texture import Atlas

Array = NDArray[np.float64]

NEAR_M = 0.05
RUN = 32
"""Pixels that may share a mip level."""
JITTER = np.array([[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]])
"""Where in the pixel the samples of one exposure lie (rotated grid), pixels."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The geometry of a scene: n parallelograms in the world frame, metres (see the module's text).

    `infrared` is what a surface returns of near infrared light (0: glass or a black screen, nothing comes back).
    """

    origin: Array
    u: Array
    v: Array
    two_sided: NDArray[np.bool_]
    infrared: NDArray[np.float32]
    patch: NDArray[np.int32]


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


@compiled
def sample_run(
    texels: NDArray[np.uint32],
    size: tuple[np.int32, np.int32],
    affine: tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32],
    origin: tuple[np.float32, np.float32],
    scratch: NDArray[np.int32],
    out: NDArray[np.uint64],
) -> None:
    """Add one surface's colour, looked up bilinearly, to a run of pixels (see `shade` for `out`).

    `affine` gives inverse depth and the two texture coordinates over depth along the run (start, slope each);
    `origin` is subtracted from the texture coordinates, all in texels of a level of `size` (width, height).
    """
    w0, wx, s0, sx, t0, tx = affine
    width = size[0]
    zero, one, unit = np.float32(0), np.float32(1), np.float32(256)
    high_s, high_t = np.float32(size[0]) - np.float32(1.01), np.float32(size[1]) - np.float32(1.01)
    n = out.shape[0]
    for x in range(n):
        k = np.float32(x)
        z = one / (w0 + wx * k)
        s = (s0 + sx * k) * z - origin[0]
        t = (t0 + tx * k) * z - origin[1]
        s = zero if s < zero else (high_s if s > high_s else s)
        t = zero if t < zero else (high_t if t > high_t else t)
        i, j = np.int32(s), np.int32(t)
        scratch[0, x] = j * width + i
        scratch[1, x] = np.int32((s - np.float32(i)) * unit)
        scratch[2, x] = np.int32((t - np.float32(j)) * unit)
    lanes = np.uint64(0x00FF00FF00FF)
    quarter = np.uint64(0x3FFF3FFF3FFF)
    spread, two = np.uint64(24), np.uint64(2)
    for x in range(n):
        at = np.uint64(scratch[0, x])
        below = at + np.uint64(width)
        fx, fy = np.int64(scratch[1, x]), np.int64(scratch[2, x])
        w11 = (fx * fy) >> 8
        c00, c10 = np.uint64(texels[at]), np.uint64(texels[at + np.uint64(1)])
        c01, c11 = np.uint64(texels[below]), np.uint64(texels[below + np.uint64(1)])
        total = ((c00 | c00 << spread) & lanes) * np.uint64(256 - fx - fy + w11)
        total += ((c10 | c10 << spread) & lanes) * np.uint64(fx - w11)
        total += ((c01 | c01 << spread) & lanes) * np.uint64(fy - w11)
        total += ((c11 | c11 << spread) & lanes) * np.uint64(w11)
        out[x] += (total >> two) & quarter


@compiled
def shade(
    identity: NDArray[np.int16],
    coefficients: Array,
    patch: NDArray[np.int32],
    level_offset: NDArray[np.int64],
    level_size: NDArray[np.int32],
    sharpness: Array,
    texels: NDArray[np.uint32],
    out: NDArray[np.uint64],
) -> None:
    """Average the textures' colour over the SAMPLES samples of an exposure.

    `identity` is k x H x W and `coefficients` k x n x 12 (see `project_surfaces`); `out` (H x W) holds 256 times the
    8 bit colour in lanes of 16 bits, red lowest, then blue, then green. Runs of up to RUN pixels of one surface
    share a mip level, by their middle's footprint; it is rounded differently from sample to sample, which blends
    neighbouring levels without looking up both.
    """
    samples, height, width = identity.shape
    levels = level_offset.shape[1]
    scratch = np.empty((3, RUN), np.int32)
    f4 = np.float32
    for y in range(height):
        out[y] = np.uint64(0)
        for k in range(samples):
            row = identity[k, y]
            x = 0
            while x < width:
                i = row[x]
                end = x + 1
                last = min(width, x + RUN)
                while end < last and row[end] == i:
                    end += 1
                if i >= 0:
                    c = coefficients[k, i]
                    p = patch[i]
                    z = 1.0 / (c[0] * (0.5 * (x + end)) + c[1] * y + c[2])
                    footprint = sharpness[k, i] * z * z * z * (0.5 + 0.5 * (k & 1) + 0.25 * (k >> 1))
                    level = 0
                    while footprint > 1.0 and level < levels - 1:
                        footprint *= 0.25
                        level += 1
                    w, h = level_size[p, level, 0], level_size[p, level, 1]
                    sample_run(
                        texels[level_offset[p, level] :],
                        (w, h),
                        (
                            f4(c[0] * x + c[1] * y + c[2]),
                            f4(c[0]),
                            f4((c[3] * x + c[4] * y + c[5]) * w),
                            f4(c[3] * w),
                            f4((c[6] * x + c[7] * y + c[8]) * h),
                            f4(c[6] * h),
                        ),
                        (f4(c[9] * w + 0.5), f4(c[10] * h + 0.5)),
                        scratch,
                        out[y, x:end],
                    )
                x = end


class Renderer:
    """Draws one scene; keeps its buffers between calls, so one object serves one thread."""

    def __init__(self, surfaces: Surfaces, atlas: Atlas) -> None:
        self.infrared = surfaces.infrared
        self._surfaces = surfaces
        self._atlas = atlas
        normal = np.cross(surfaces.u, surfaces.v)
        self._area = np.linalg.norm(normal, axis=1)
        self._normal = normal / self._area[:, None]
        size = atlas.level_size[surfaces.patch, 0].astype(float)
        self._texels_per_m2 = size[:, 0] * size[:, 1] / self._area

    def _project(self, T_camera_world: Array, K: Array) -> Array:
        s = self._surfaces
        out = np.zeros((len(s.origin), 12))
        project_surfaces(s.origin, s.u, s.v, s.two_sided, T_camera_world, K, out)
        return out

    def depth(
        self, T_camera_world: Array, K: Array, shape: tuple[int, int]
    ) -> tuple[NDArray[np.float32], NDArray[np.int16], Array]:
        """Return inverse depth (1/m), the number of the surface in each pixel and each surface's distance (m)."""
        s = self._surfaces
        inverse_depth = np.empty(shape, np.float32)
        identity = np.empty(shape, np.int16)
        rasterise(s.origin, s.u, s.v, self._project(T_camera_world, K), T_camera_world, K, inverse_depth, identity)
        return inverse_depth, identity, self._distance(T_camera_world)

    def _distance(self, T_camera_world: Array) -> Array:
        eye = -T_camera_world[:3, :3].T @ T_camera_world[:3, 3]
        return np.asarray(np.abs(np.einsum("ni,ni->n", self._normal, self._surfaces.origin - eye)))

    def color(self, T_camera_world: Array, K: Array, shape: tuple[int, int]) -> NDArray[np.uint64]:
        """Return the light (packed, see `shade`) of an exposure during which the camera took the 4 poses given."""
        s, atlas = self._surfaces, self._atlas
        samples = len(JITTER)
        identity = np.empty((samples, *shape), np.int16)
        inverse_depth = np.empty(shape, np.float32)
        coefficients = np.zeros((samples, len(s.origin), 12))
        sharpness = np.empty((samples, len(s.origin)))
        for k, T in enumerate(T_camera_world):
            K_k = K - np.array([0.0, 0.0, *JITTER[k]])
            project_surfaces(s.origin, s.u, s.v, s.two_sided, T, K_k, coefficients[k])
            rasterise(s.origin, s.u, s.v, coefficients[k], T, K_k, inverse_depth, identity[k])
            # A pixel covers z^2 / (f^2 cos) m^2, cos = distance / z at the image centre; four samples share it.
            sharpness[k] = self._texels_per_m2 / (K[0] * K[1] * np.maximum(self._distance(T), 0.01)) / 2.0
        out = np.empty(shape, np.uint64)
        shade(identity, coefficients, s.patch, atlas.level_offset, atlas.level_size, sharpness, atlas.texels, out)
        return out
