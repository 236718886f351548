"""How a key frame's surface patch appears from another pose."""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.camera.lens import Lens, in_numbers, pixel_of, ray_at
from odom.frontend.features.tuning import TUNING
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled

_WARP_LIMITS = (TUNING.warp_step_px, TUNING.warp_smallest_area, TUNING.warp_largest_area)
"""What `homographies` differentiates with, and the ratios of areas between which a patch is used."""
_NEAREST = 1e-3
"""Depth in units of that in the reference: nearer points count as behind the camera."""


@compiled
def _seen_beside(
    uv_reference: Array,
    plane_reference: Array,
    keyframe: Index,
    T_current_keyframe: Array,
    rays: NDArray[np.float32],
    step: float,
    seen: Array,
) -> None:
    """Fill `seen` (3 x 4 n): the points of n surfaces `step` pixels left, right, above and below their middles.

    They are X, Y and Z in the current camera's frame, in units of the depth in the reference.
    """
    n = uv_reference.shape[0]
    for k in range(n):
        T, at = T_current_keyframe, keyframe[k]
        u, v = uv_reference[k, 0], uv_reference[k, 1]
        w, su, sv = plane_reference[k, 0], plane_reference[k, 1] * step, plane_reference[k, 2] * step
        for side in range(4):
            if side < 2:
                x, y = ray_at(rays, u + step if side else u - step, v)
                ws = w + su if side else w - su
            else:
                x, y = ray_at(rays, u, v + step if side == 3 else v - step)
                ws = w + sv if side == 3 else w - sv
            m = side * n + k
            seen[0, m] = T[at, 0, 0] * x + T[at, 0, 1] * y + T[at, 0, 2] + T[at, 0, 3] * ws
            seen[1, m] = T[at, 1, 0] * x + T[at, 1, 1] * y + T[at, 1, 2] + T[at, 1, 3] * ws
            seen[2, m] = T[at, 2, 0] * x + T[at, 2, 1] * y + T[at, 2, 2] + T[at, 2, 3] * ws


def homographies(
    uv_reference: Array, plane_reference: Array, keyframe: Index, T_current_keyframe: Array, lens: Lens
) -> tuple[Array, Mask]:
    """Return for n patches the 3 x 2 matrix that maps a pixel offset d in the current image to the reference image.

    Its upper part A and its last row h say A d / (1 + h d): a homography, since a surface that slants appears more
    strongly magnified where it is nearer. An affinity alone would have patches found off to one side.

    `uv_reference` (n x 2 px), `plane_reference` (n x 3: inverse depth in 1/m and its slope per pixel in u, v) describe
    the surface in key frame `keyframe` (n), whose motion is `T_current_keyframe[keyframe]`. The second value is False
    where the surface is seen from behind, too steeply, or from much farther or nearer.
    """
    of_lens = lens.rays, lens.intrinsics, lens.projection
    return _homographies(uv_reference, plane_reference, keyframe, T_current_keyframe, *of_lens, _WARP_LIMITS)


@compiled
def _homographies(
    uv_reference: Array,
    plane_reference: Array,
    keyframe: Index,
    T_current_keyframe: Array,
    rays: NDArray[np.float32],
    intrinsics: Array,
    projection: Array,
    limits: tuple[float, float, float],
) -> tuple[Array, Mask]:
    """Return matrices and which of them are usable as `homographies` does; `limits`: see `_WARP_LIMITS`."""
    step, smallest_area, largest_area = limits
    n = uv_reference.shape[0]
    H = np.zeros((n, 3, 2))
    usable = np.zeros(n, np.bool_)
    seen = np.empty((3, 4 * n))
    _seen_beside(uv_reference, plane_reference, keyframe, T_current_keyframe, rays, step, seen)
    intrinsics_, projection_ = in_numbers(intrinsics, projection)
    X, Y, Z = seen
    for m in range(4 * n):
        u, v = pixel_of(X[m] / Z[m], Y[m] / Z[m], intrinsics_, projection_)
        X[m], Y[m] = u if Z[m] >= _NEAREST else np.nan, v if Z[m] >= _NEAREST else np.nan
    for k in range(n):
        left, right, above, below = k, n + k, 2 * n + k, 3 * n + k
        a, b = (X[right] - X[left]) / (2.0 * step), (X[below] - X[above]) / (2.0 * step)
        c, d = (Y[right] - Y[left]) / (2.0 * step), (Y[below] - Y[above]) / (2.0 * step)
        area = a * d - b * c
        if smallest_area < area < largest_area:
            A00, A01, A10, A11 = d / area, -b / area, -c / area, a / area
            H[k, 0, 0], H[k, 0, 1], H[k, 1, 0], H[k, 1, 1] = A00, A01, A10, A11
            # the depth in the current image is linear in the reference's pixels: 1 + g d, g per pixel
            gu = (Z[right] - Z[left]) / ((Z[left] + Z[right]) * step)
            gv = (Z[below] - Z[above]) / ((Z[above] + Z[below]) * step)
            H[k, 2, 0], H[k, 2, 1] = -gu * A00 - gv * A10, -gu * A01 - gv * A11
            usable[k] = True
    return H, usable


def at_half_size(H: Array) -> Array:
    """Return the homographies (n x 3 x 2, see `homographies`) of the same patches in images of half the size."""
    return np.asarray(H * np.array([[1.0], [1.0], [2.0]]))
