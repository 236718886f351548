"""The depth image at a feature: the plane through its neighbourhood, and nothing where pixels are mixed."""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

_WINDOW = 3
"""The window is 2 * 3 + 1 = 7 pixels square: compiled in, since the loops over it are."""
_SAMPLED_EVERY = 8
"""Pixels apart of the sample that tells whether an image shows depth at all: 4,800 of a VGA image."""
PLANE_LIMITS = (TUNING.depth_step, TUNING.depth_share_valid, TUNING.depth_share_on_surface)
"""What `read_plane` demands of a neighbourhood."""


def has_depth(depth_mm: NDArray[np.uint16]) -> bool:
    """Return whether a depth image (H x W uint16, mm, 0: none) shows anything; a sample of its pixels is looked at."""
    sample = depth_mm[::_SAMPLED_EVERY, ::_SAMPLED_EVERY]
    return bool(np.count_nonzero(sample) >= TUNING.depth_least_share * sample.size)


@compiled
def median_of(values: Array, m: int, room: Array) -> float:
    """Return the median of the first `m` of some `values`, in `room` as large as they are (Hoare's selection)."""
    room[:m] = values[:m]
    k, low, high = m // 2, 0, m - 1
    while low < high:
        pivot = room[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while room[i] < pivot:
                i += 1
            while room[j] > pivot:
                j -= 1
            if i <= j:
                room[i], room[j] = room[j], room[i]
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            break
    if m % 2:
        return float(room[k])
    below = room[0]
    for i in range(1, k):
        below = max(below, room[i])
    return float(0.5 * (below + room[k]))


@compiled
def read_plane(
    depth_mm: NDArray[np.uint16], u: float, v: float, limits: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return inverse depth (1/m) at (u, v) and its slope per pixel in u and v; all NaN where it cannot be trusted.

    The inverse depth of a plane is affine in the pixel, so an affine function is fitted to those of the 7 x 7
    neighbours that lie near their median. `limits` (see `PLANE_LIMITS`) are: how far from the median a neighbour may
    lie, as a share of it; which share of the window must be measured; which share of that must lie near the median.
    Otherwise the pixel is at a depth edge, where a sensor mixes foreground and background.
    """
    step, share_valid, share_on_surface = limits
    height, width = depth_mm.shape
    nothing = (np.nan, np.nan, np.nan)
    if not (_WINDOW <= u < width - _WINDOW - 1 and _WINDOW <= v < height - _WINDOW - 1):
        return nothing
    size = (2 * _WINDOW + 1) ** 2
    values = np.empty(size)
    du = np.empty(size)
    dv = np.empty(size)
    in_order = np.empty(size)
    j0, i0 = round(u), round(v)
    m = 0
    for i in range(i0 - _WINDOW, i0 + _WINDOW + 1):
        for j in range(j0 - _WINDOW, j0 + _WINDOW + 1):
            if depth_mm[i, j] > 0:
                values[m] = 1000.0 / depth_mm[i, j]
                du[m] = j - u
                dv[m] = i - v
                m += 1
    if m < share_valid * size:
        return nothing
    median = median_of(values, m, in_order)
    # sums of the normal equations of w = b0 + b1 du + b2 dv over the neighbours near the median
    count = 0
    a01 = a02 = a11 = a12 = a22 = b0 = b1 = b2 = 0.0
    for s in range(m):
        if abs(values[s] - median) <= step * median:
            count += 1
            a01 += du[s]
            a02 += dv[s]
            a11 += du[s] * du[s]
            a12 += du[s] * dv[s]
            a22 += dv[s] * dv[s]
            b0 += values[s]
            b1 += values[s] * du[s]
            b2 += values[s] * dv[s]
    if count < share_on_surface * m or count < share_valid * size:
        return nothing
    # solved by Cramer's rule: cofactors of the symmetric 3 x 3 matrix
    a00 = float(count)
    c00 = a11 * a22 - a12 * a12
    c01 = a02 * a12 - a01 * a22
    c02 = a01 * a12 - a02 * a11
    c11 = a00 * a22 - a02 * a02
    c12 = a01 * a02 - a00 * a12
    c22 = a00 * a11 - a01 * a01
    determinant = a00 * c00 + a01 * c01 + a02 * c02
    return (
        (c00 * b0 + c01 * b1 + c02 * b2) / determinant,
        (c01 * b0 + c11 * b1 + c12 * b2) / determinant,
        (c02 * b0 + c12 * b1 + c22 * b2) / determinant,
    )
