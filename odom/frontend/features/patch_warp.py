"""How a key frame's surface patch appears from another pose."""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.camera.lens import pixel_of, ray_at
from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled

WARP_LIMITS = (TUNING.warp_step_px, TUNING.warp_smallest_area, TUNING.warp_largest_area)
"""What `affinities` differentiates with, and the ratios of areas between which a patch is used."""


@compiled
def _pixel_in_current(
    T_current_reference: Array,
    rays: NDArray[np.float32],
    intrinsics: Array,
    distortion: Array,
    u: float,
    v: float,
    w: float,
) -> tuple[float, float]:
    T = T_current_reference
    x, y = ray_at(rays, u, v)
    X = T[0, 0] * x + T[0, 1] * y + T[0, 2] + T[0, 3] * w
    Y = T[1, 0] * x + T[1, 1] * y + T[1, 2] + T[1, 3] * w
    Z = T[2, 0] * x + T[2, 1] * y + T[2, 2] + T[2, 3] * w
    if Z < 1e-3:
        return np.nan, np.nan
    return pixel_of(X / Z, Y / Z, intrinsics, distortion)


@compiled
def affinities(
    uv_reference: Array,
    plane_reference: Array,
    keyframe: Index,
    T_current_keyframe: Array,
    rays: NDArray[np.float32],
    intrinsics: Array,
    distortion: Array,
    limits: tuple[float, float, float],
) -> tuple[Array, Mask]:
    """Return for n patches the 2 x 2 matrix that maps a pixel offset in the current image to the reference image.

    `uv_reference` (n x 2 px), `plane_reference` (n x 3: inverse depth in 1/m and its slope per pixel in u, v) describe
    the surface in key frame `keyframe` (n), whose motion is `T_current_keyframe[keyframe]`. The second value is False
    where the surface is seen from behind, too steeply, or from much farther or nearer (`limits`: see `WARP_LIMITS`).
    """
    step, smallest_area, largest_area = limits
    n = uv_reference.shape[0]
    A = np.zeros((n, 2, 2))
    usable = np.zeros(n, np.bool_)
    for k in range(n):
        T = T_current_keyframe[keyframe[k]]
        u, v = uv_reference[k, 0], uv_reference[k, 1]
        w, su, sv = plane_reference[k, 0], plane_reference[k, 1], plane_reference[k, 2]
        u0, v0 = _pixel_in_current(T, rays, intrinsics, distortion, u, v, w)
        u1, v1 = _pixel_in_current(T, rays, intrinsics, distortion, u + step, v, w + su * step)
        u2, v2 = _pixel_in_current(T, rays, intrinsics, distortion, u, v + step, w + sv * step)
        a, b = (u1 - u0) / step, (u2 - u0) / step
        c, d = (v1 - v0) / step, (v2 - v0) / step
        area = a * d - b * c
        if smallest_area < area < largest_area:
            A[k, 0, 0], A[k, 0, 1], A[k, 1, 0], A[k, 1, 1] = d / area, -b / area, -c / area, a / area
            usable[k] = True
    return A, usable
