"""What colour each pixel gets: mip-mapped textures looked up for every sample of an exposure, and averaged."""

import numpy as np
from numpy.typing import NDArray

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from sensors.arena.array_types import Identity, Light
from sensors.arena.atlas import Atlas

RUN = 32
"""Pixels that may share a mip level: more show the border between levels, fewer are slower."""


@compiled
def sample_run(
    texels: NDArray[np.uint32],
    size: tuple[np.int32, np.int32],
    affine: tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32],
    origin: tuple[np.float32, np.float32],
    scratch: NDArray[np.int32],
    out: Light,
) -> None:
    """Add one surface's colour, looked up bilinearly, to a run of pixels.

    `affine` gives inverse depth and the two texture coordinates over depth along the run (start, slope each);
    `origin` is subtracted from the texture coordinates, all in texels of a level of `size` (width, height).
    Three passes: where the pixels look, the four texels around each, and their mean by fixed point weights.
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
        s, t = s if s > zero else zero, t if t > zero else zero
        s, t = high_s if s > high_s else s, high_t if t > high_t else t
        i, j = np.int32(s), np.int32(t)
        scratch[0, x] = j * width + i
        scratch[1, x] = np.int32((s - np.float32(i)) * unit)
        scratch[2, x] = np.int32((t - np.float32(j)) * unit)
    for x in range(n):
        at = np.uint64(scratch[0, x])
        below = at + np.uint64(width)
        scratch[3, x], scratch[4, x] = texels[at], texels[at + np.uint64(1)]
        scratch[5, x], scratch[6, x] = texels[below], texels[below + np.uint64(1)]
    lanes, byte, eight = np.uint32(0x00FF00FF), np.uint32(0xFF), np.uint32(8)
    quarter, two, whole = np.uint32(0x3FFF3FFF), np.uint32(2), np.uint32(256)
    for x in range(n):
        fx, fy = np.uint32(scratch[1, x]), np.uint32(scratch[2, x])
        w11 = np.uint32(fx * fy) >> eight
        w10, w01, w00 = np.uint32(fx - w11), np.uint32(fy - w11), np.uint32(whole - fx - fy + w11)
        c00, c10 = np.uint32(scratch[3, x]), np.uint32(scratch[4, x])
        c01, c11 = np.uint32(scratch[5, x]), np.uint32(scratch[6, x])
        both = np.uint32((c00 & lanes) * w00 + (c10 & lanes) * w10 + (c01 & lanes) * w01 + (c11 & lanes) * w11)
        c00, c10, c01, c11 = c00 >> eight & byte, c10 >> eight & byte, c01 >> eight & byte, c11 >> eight & byte
        green = np.uint32(c00 * w00 + c10 * w10 + c01 * w01 + c11 * w11)
        out[x] += np.uint64(both >> two & quarter) | np.uint64(green >> two) << np.uint64(32)


@compiled
def shade(
    identity: Identity, coefficients: Array, patch: NDArray[np.int32], atlas: Atlas, sharpness: Array, out: Light
) -> None:
    """Fill `out` with the textures' colour, averaged over the four samples of an exposure.

    `identity` is k x H x W, `coefficients` k x n x 12 (see `project_surfaces`), and `sharpness` (k x n) texels in a
    pixel at 1 m. Runs of up to RUN pixels of one surface share a mip level, by their middle's footprint; it is rounded
    differently from sample to sample, which blends neighbouring levels without looking up both.
    """
    texels, level_offset, level_size = atlas
    samples, height, width = identity.shape
    levels = level_offset.shape[1]
    scratch = np.empty((7, RUN), np.int32)
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
