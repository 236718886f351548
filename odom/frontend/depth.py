"""Reading the depth image at a feature with care: a local plane, and no mixed pixels."""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled

_WINDOW = 3
_SHARE_VALID = 0.5
_SHARE_ON_SURFACE = 0.85
_LEAST_SHARE, _SAMPLED_EVERY = 0.01, 8


def has_depth(depth_mm: NDArray[np.uint16]) -> bool:
    """Say whether a depth image shows anything: at least 1 % of its pixels, of which every 64th is looked at."""
    sample = depth_mm[::_SAMPLED_EVERY, ::_SAMPLED_EVERY]
    return bool(np.count_nonzero(sample) >= _LEAST_SHARE * sample.size)


@compiled
def read_plane(depth_mm: NDArray[np.uint16], u: float, v: float, relative_step: float) -> tuple[float, float, float]:
    """Return inverse depth (1/m) at (u, v) and its slope per pixel in u and v; all NaN where there is none to trust.

    The inverse depth of a plane is affine in the pixel, so a plane is fitted to the 7 x 7 neighbours that lie within
    `relative_step` (of the depth) of the median. A point where less than half of the window is measured, or where too
    much of it is off that surface, stands at a depth edge, where a sensor mixes foreground and background: refused.
    """
    height, width = depth_mm.shape
    nothing = (np.nan, np.nan, np.nan)
    if not (_WINDOW <= u < width - _WINDOW - 1 and _WINDOW <= v < height - _WINDOW - 1):
        return nothing
    size = (2 * _WINDOW + 1) ** 2
    values = np.empty(size)
    du = np.empty(size)
    dv = np.empty(size)
    j0, i0 = round(u), round(v)
    m = 0
    for i in range(i0 - _WINDOW, i0 + _WINDOW + 1):
        for j in range(j0 - _WINDOW, j0 + _WINDOW + 1):
            if depth_mm[i, j] > 0:
                values[m] = 1000.0 / depth_mm[i, j]
                du[m] = j - u
                dv[m] = i - v
                m += 1
    if m < _SHARE_VALID * size:
        return nothing
    median = np.median(values[:m])
    count = 0
    a01 = a02 = a11 = a12 = a22 = b0 = b1 = b2 = 0.0
    for s in range(m):
        if abs(values[s] - median) <= relative_step * median:
            count += 1
            a01 += du[s]
            a02 += dv[s]
            a11 += du[s] * du[s]
            a12 += du[s] * dv[s]
            a22 += dv[s] * dv[s]
            b0 += values[s]
            b1 += values[s] * du[s]
            b2 += values[s] * dv[s]
    if count < _SHARE_ON_SURFACE * m or count < _SHARE_VALID * size:
        return nothing
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
