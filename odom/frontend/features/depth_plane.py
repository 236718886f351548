"""The depth image at a feature: the plane through its neighbourhood, and nothing where pixels are mixed."""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.features.tuning import TUNING
from odom.geometry.arrays import Array
from odom.geometry.compiled import vectorised

_WINDOW = 3
"""The window is 2 * 3 + 1 = 7 pixels square: a constant, so that the compiler unrolls the loops over it."""
_SIDE = 2 * _WINDOW + 1
"""Pixels along a side of the window."""
_SAMPLED_EVERY = 8
"""Distance in pixels of the sample that tells whether an image shows depth at all: 4,800 of a VGA image."""
PLANE_LIMITS = (TUNING.depth_step, TUNING.depth_share_valid, TUNING.depth_share_on_surface)
"""What `read_planes` demands of a neighbourhood."""


def has_depth(depth_mm: NDArray[np.uint16]) -> bool:
    """Return whether a depth image (H x W uint16, mm, 0: none) shows anything; a sample of its pixels is looked at."""
    sample = depth_mm[::_SAMPLED_EVERY, ::_SAMPLED_EVERY]
    return bool(np.count_nonzero(sample) >= TUNING.depth_least_share * sample.size)


@vectorised
def read_planes(depth_mm: NDArray[np.uint16], uv: Array, limits: tuple[float, float, float]) -> Array:
    """Return (n x 3): inverse depth (1/m) at places `uv` (n x 2 px), and its slope per pixel in u and v.

    All three are NaN where the depth cannot be trusted. The inverse depth of a plane is affine in the pixel, so an
    affine function is fitted to those of the 7 x 7 neighbours that lie near their median. `limits` (see `PLANE_LIMITS`)
    are: how far from the median a neighbour may lie, as a share of it; which share of the window must be measured;
    which share of that must lie near the median. Otherwise the pixel is at a depth edge, where a sensor mixes
    foreground and background.
    """
    step, share_valid, share_on_surface = limits
    height, width = depth_mm.shape
    n = uv.shape[0]
    out = np.full((n, 3), np.nan)
    size = _SIDE * _SIDE
    place = np.arange(size)
    dx, dy = (place % _SIDE - _WINDOW).astype(np.float64), (place // _SIDE - _WINDOW).astype(np.float64)
    values, counts = np.zeros(size), np.zeros(size)
    for k in range(n):
        u, v = uv[k, 0], uv[k, 1]
        if not (_WINDOW <= u < width - _WINDOW - 1 and _WINDOW <= v < height - _WINDOW - 1):
            continue
        # inverse depths of the window, and 1 where there is one
        j0, i0 = round(u), round(v)
        for y in range(_SIDE):
            row = depth_mm[i0 - _WINDOW + y, j0 - _WINDOW : j0 + _WINDOW + 1]
            for x in range(_SIDE):
                values[y * _SIDE + x] = row[x]
        measured = 0.0
        for s in range(size):
            is_measured = 1.0 if values[s] > 0.0 else 0.0
            values[s] = is_measured * (1000.0 / max(values[s], 1.0))
            counts[s] = is_measured
            measured += is_measured
        if measured < share_valid * size:
            continue
        # those near the median count, which are all of them where the farthest two are near each other
        least, most = np.inf, 0.0
        for s in range(size):
            least = min(least, values[s] if values[s] > 0.0 else np.inf)
            most = max(most, values[s])
        if most - least > step * least:
            # the median is the value with half of them below it; those that were not measured are below all
            lower, upper = int(size - measured) + (int(measured) - 1) // 2, int(size - measured) + int(measured) // 2
            low = high = np.inf
            for s in range(size):
                below, not_above = 0, 0
                for r in range(size):
                    below += values[r] < values[s]
                    not_above += values[r] <= values[s]
                low = values[s] if below <= lower < not_above else low
                high = values[s] if below <= upper < not_above else high
                if low < np.inf and high < np.inf:
                    break
            median = 0.5 * (low + high)
            for s in range(size):
                counts[s] = counts[s] if abs(values[s] - median) <= step * median else 0.0
        # sums of the normal equations of w = b0 + b1 dx + b2 dy over them, from the middle pixel
        a00 = a01 = a02 = a11 = a12 = a22 = b0 = b1 = b2 = 0.0
        for s in range(size):
            x, y = counts[s] * dx[s], counts[s] * dy[s]
            a00 += counts[s]
            a01 += x
            a02 += y
            a11 += x * dx[s]
            a12 += x * dy[s]
            a22 += y * dy[s]
            b0 += counts[s] * values[s]
            b1 += x * values[s]
            b2 += y * values[s]
        if a00 < share_on_surface * measured or a00 < share_valid * size:
            continue
        # solved by Cramer's rule: cofactors of the symmetric 3 x 3 matrix
        c00 = a11 * a22 - a12 * a12
        c01 = a02 * a12 - a01 * a22
        c02 = a01 * a12 - a02 * a11
        c11 = a00 * a22 - a02 * a02
        c12 = a01 * a02 - a00 * a12
        c22 = a00 * a11 - a01 * a01
        determinant = a00 * c00 + a01 * c01 + a02 * c02
        slope_u = (c01 * b0 + c11 * b1 + c12 * b2) / determinant
        slope_v = (c02 * b0 + c12 * b1 + c22 * b2) / determinant
        out[k, 0] = (c00 * b0 + c01 * b1 + c02 * b2) / determinant + slope_u * (u - j0) + slope_v * (v - i0)
        out[k, 1], out[k, 2] = slope_u, slope_v
    return out
