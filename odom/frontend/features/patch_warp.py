"""How a key frame's surface patch appears from another pose."""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.camera.lens import pixel_of, ray_at
from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled

WARP_LIMITS = (TUNING.warp_step_px, TUNING.warp_smallest_area, TUNING.warp_largest_area)
"""What `homographies` differentiates with, and the ratios of areas between which a patch is used."""


@compiled
def _in_current(
    T_current_reference: Array,
    rays: NDArray[np.float32],
    intrinsics: Array,
    distortion: Array,
    u: float,
    v: float,
    w: float,
) -> tuple[float, float, float]:
    """Return the pixel that shows in the current image what the reference shows at `u`, `v`, inverse depth `w`.

    With it comes its depth there in units of that in the reference.
    """
    T = T_current_reference
    x, y = ray_at(rays, u, v)
    X = T[0, 0] * x + T[0, 1] * y + T[0, 2] + T[0, 3] * w
    Y = T[1, 0] * x + T[1, 1] * y + T[1, 2] + T[1, 3] * w
    Z = T[2, 0] * x + T[2, 1] * y + T[2, 2] + T[2, 3] * w
    if Z < 1e-3:
        return np.nan, np.nan, Z
    u_current, v_current = pixel_of(X / Z, Y / Z, intrinsics, distortion)
    return u_current, v_current, Z


@compiled
def homographies(
    uv_reference: Array,
    plane_reference: Array,
    keyframe: Index,
    T_current_keyframe: Array,
    rays: NDArray[np.float32],
    intrinsics: Array,
    distortion: Array,
    limits: tuple[float, float, float],
) -> tuple[Array, Mask]:
    """Return for n patches the 3 x 2 matrix that maps a pixel offset d in the current image to the reference image.

    Its upper part A and its last row h say A d / (1 + h d): a homography, since a surface that slants appears more
    strongly magnified where it is nearer. An affinity alone would have patches found off to one side.

    `uv_reference` (n x 2 px), `plane_reference` (n x 3: inverse depth in 1/m and its slope per pixel in u, v) describe
    the surface in key frame `keyframe` (n), whose motion is `T_current_keyframe[keyframe]`. The second value is False
    where the surface is seen from behind, too steeply, or from much farther or nearer (`limits`: see `WARP_LIMITS`).
    """
    step, smallest_area, largest_area = limits
    n = uv_reference.shape[0]
    H = np.zeros((n, 3, 2))
    usable = np.zeros(n, np.bool_)
    for k in range(n):
        T = T_current_keyframe[keyframe[k]]
        u, v = uv_reference[k, 0], uv_reference[k, 1]
        w, su, sv = plane_reference[k, 0], plane_reference[k, 1] * step, plane_reference[k, 2] * step
        u1, v1, z1 = _in_current(T, rays, intrinsics, distortion, u - step, v, w - su)
        u2, v2, z2 = _in_current(T, rays, intrinsics, distortion, u + step, v, w + su)
        u3, v3, z3 = _in_current(T, rays, intrinsics, distortion, u, v - step, w - sv)
        u4, v4, z4 = _in_current(T, rays, intrinsics, distortion, u, v + step, w + sv)
        a, b = (u2 - u1) / (2.0 * step), (u4 - u3) / (2.0 * step)
        c, d = (v2 - v1) / (2.0 * step), (v4 - v3) / (2.0 * step)
        area = a * d - b * c
        if smallest_area < area < largest_area:
            A = H[k]
            A[0, 0], A[0, 1], A[1, 0], A[1, 1] = d / area, -b / area, -c / area, a / area
            # the depth in the current image is linear in the reference's pixels: 1 + g d, g per pixel
            gu, gv = (z2 - z1) / ((z1 + z2) * step), (z4 - z3) / ((z3 + z4) * step)
            A[2, 0], A[2, 1] = -gu * A[0, 0] - gv * A[1, 0], -gu * A[0, 1] - gv * A[1, 1]
            usable[k] = True
    return H, usable


def at_half_size(H: Array) -> Array:
    """Return the homographies (n x 3 x 2, see `homographies`) of the same patches in images of half the size."""
    return np.asarray(H * np.array([[1.0], [1.0], [2.0]]))
