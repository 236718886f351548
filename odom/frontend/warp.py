"""How a key frame's surface patch appears from another pose."""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.lens import pixel_of, ray_at
from odom.registration.compiled import compiled

Array = NDArray[np.float64]

_STEP_PX = 4.0
_SMALLEST_AREA, _LARGEST_AREA = 0.15, 6.0


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
    keyframe: NDArray[np.int64],
    T_current_keyframe: Array,
    rays: NDArray[np.float32],
    intrinsics: Array,
    distortion: Array,
) -> tuple[Array, NDArray[np.bool_]]:
    """Return for n patches the 2 x 2 matrix that maps a pixel offset in the current image to the reference image.

    `uv_reference` (n x 2 px), `plane_reference` (n x 3: inverse depth in 1/m and its slope per pixel in u, v) describe
    the surface in key frame `keyframe` (n), whose motion is `T_current_keyframe[keyframe]`. The second value is False
    where the surface is seen from behind, too steeply, or more than about twice as large or half as large.
    """
    n = uv_reference.shape[0]
    A = np.zeros((n, 2, 2))
    usable = np.zeros(n, np.bool_)
    for k in range(n):
        T = T_current_keyframe[keyframe[k]]
        u, v = uv_reference[k, 0], uv_reference[k, 1]
        w, su, sv = plane_reference[k, 0], plane_reference[k, 1], plane_reference[k, 2]
        u0, v0 = _pixel_in_current(T, rays, intrinsics, distortion, u, v, w)
        u1, v1 = _pixel_in_current(T, rays, intrinsics, distortion, u + _STEP_PX, v, w + su * _STEP_PX)
        u2, v2 = _pixel_in_current(T, rays, intrinsics, distortion, u, v + _STEP_PX, w + sv * _STEP_PX)
        a, b = (u1 - u0) / _STEP_PX, (u2 - u0) / _STEP_PX
        c, d = (v1 - v0) / _STEP_PX, (v2 - v0) / _STEP_PX
        area = a * d - b * c
        if _SMALLEST_AREA < area < _LARGEST_AREA:
            A[k, 0, 0], A[k, 0, 1], A[k, 1, 0], A[k, 1, 1] = d / area, -b / area, -c / area, a / area
            usable[k] = True
    return A, usable
