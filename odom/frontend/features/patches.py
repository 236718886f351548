"""Small image patches: cut at a key frame's corners, found again at sub-pixel precision in another image.

The reference patch is warped by the affinity that the predicted pose and the surface imply, then aligned in
translation, gain and offset (inverse compositional Gauss-Newton: S. Baker, I. Matthews, IJCV 56, 2004).
"""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Array, Image, Mask
from odom.geometry.compiled import compiled

RADIUS = 12
"""A stored patch is (2 RADIUS + 1) pixels square: an aligned one turned by 45 degrees and magnified by half fits in."""
_HALF = 5
"""An aligned patch is (2 _HALF + 1) = 11 pixels square; smaller ones are ambiguous, larger ones cost more and bend."""
_PIXELS = (2 * _HALF + 1) ** 2
"""Pixels of an aligned patch."""
_LEAST_DETERMINANT = 1e-3
"""Determinant of the structure tensor over its squared trace: below, the patch is an edge and slides along itself."""
PATCH_LIMITS = (TUNING.patch_least_contrast, TUNING.patch_least_gain, TUNING.patch_converged_px**2)
"""What `align_patches` demands of a patch and its alignment."""


@compiled
def cut_patches(image: Image, uv: Array) -> Image:
    """Return n patches (n, 2 RADIUS + 1, 2 RADIUS + 1) uint8 centred exactly on `uv`, clamped at the border."""
    height, width = image.shape
    n = uv.shape[0]
    size = 2 * RADIUS + 1
    out = np.empty((n, size, size), np.uint8)
    for k in range(n):
        for y in range(size):
            v = min(max(uv[k, 1] + y - RADIUS, 0.0), height - 1.001)
            i = int(v)
            b = v - i
            for x in range(size):
                u = min(max(uv[k, 0] + x - RADIUS, 0.0), width - 1.001)
                j = int(u)
                a = u - j
                out[k, y, x] = round(
                    (1 - b) * ((1 - a) * image[i, j] + a * image[i, j + 1])
                    + b * ((1 - a) * image[i + 1, j] + a * image[i + 1, j + 1])
                )
    return out


@compiled
def align_patches(
    image: Image,
    patches: Image,
    A_reference_current: Array,
    uv: Array,
    valid: Mask,
    iterations: int,
    limit_px: float,
    limits: tuple[float, float, float],
) -> tuple[NDArray[np.float32], Array]:
    """Align each `valid` patch in `image` from the start `uv` (n x 2, changed in place, pixels of `image`).

    `A_reference_current` (n x 2 x 2) maps an offset in `image` to one in the patch. `limits` (see `PATCH_LIMITS`) are
    the least variance of a patch (grey^2), the least gain, and the square of the step at which it has converged (px^2).
    Returns (n,) the normalised cross-correlation, 0 where the alignment left `limit_px` around the start, the image, or
    the patch; and (n x 3) the covariance (uu, uv, vv in px^2) for one grey level of image noise, by the structure
    tensor. With template T, gradient g and image I the step solves H du = -sum g (I - gain T - offset) / gain, where g
    was made orthogonal to T and to 1, so that gain and offset need not be estimated (Baker, Matthews, 2004, part 3).
    """
    least_variance, least_gain, converged_px2 = limits
    height, width = image.shape
    n = uv.shape[0]
    score = np.zeros(n, np.float32)
    covariance = np.zeros((n, 3))
    T = np.empty(_PIXELS, np.float32)
    gx = np.empty(_PIXELS, np.float32)
    gy = np.empty(_PIXELS, np.float32)
    side = 2 * _HALF + 3
    warped = np.empty((side, side), np.float32)
    for k in range(n):
        if not valid[k]:
            continue
        a00, a01 = A_reference_current[k, 0, 0], A_reference_current[k, 0, 1]
        a10, a11 = A_reference_current[k, 1, 0], A_reference_current[k, 1, 1]
        reach = (_HALF + 1) * max(abs(a00) + abs(a01), abs(a10) + abs(a11))
        if reach > RADIUS - 0.01:
            continue
        # the reference patch as the predicted pose shows it, with a border of one pixel for its gradient (bilinear)
        patch = patches[k]
        for y in range(side):
            for x in range(side):
                dx, dy = np.float32(x - _HALF - 1), np.float32(y - _HALF - 1)
                u = np.float32(a00 * dx + a01 * dy + RADIUS)
                v = np.float32(a10 * dx + a11 * dy + RADIUS)
                j, i = int(u), int(v)
                a, b = u - j, v - i
                p00, p01 = np.float32(patch[i, j]), np.float32(patch[i, j + 1])
                p10, p11 = np.float32(patch[i + 1, j]), np.float32(patch[i + 1, j + 1])
                top = p00 + a * (p01 - p00)
                warped[y, x] = top + b * (p10 + a * (p11 - p10) - top)
        # template T without its mean, its gradient, and the sums of their products
        mean = np.float32(0)
        for y in range(1, side - 1):
            for x in range(1, side - 1):
                mean += warped[y, x]
        mean /= _PIXELS
        sxx = sxy = syy = sxt = syt = sx = sy = stt = np.float32(0)
        m = 0
        for y in range(1, side - 1):
            for x in range(1, side - 1):
                t = warped[y, x] - mean
                dx = np.float32(0.5) * (warped[y, x + 1] - warped[y, x - 1])
                dy = np.float32(0.5) * (warped[y + 1, x] - warped[y - 1, x])
                T[m], gx[m], gy[m] = t, dx, dy
                m += 1
                sxx += dx * dx
                sxy += dx * dy
                syy += dy * dy
                sxt += dx * t
                syt += dy * t
                sx += dx
                sy += dy
                stt += t * t
        if stt < least_variance * _PIXELS:
            continue
        # gain and offset are eliminated: gradients are made orthogonal to T and to 1; h is the Hessian that remains
        hxx = sxx - sxt * sxt / stt - sx * sx / _PIXELS
        hxy = sxy - sxt * syt / stt - sx * sy / _PIXELS
        hyy = syy - syt * syt / stt - sy * sy / _PIXELS
        determinant = hxx * hyy - hxy * hxy
        if determinant < _LEAST_DETERMINANT * (hxx + hyy) * (hxx + hyy) or determinant <= 0:
            continue
        for m in range(_PIXELS):
            gx[m] -= sxt / stt * T[m] + sx / _PIXELS
            gy[m] -= syt / stt * T[m] + sy / _PIXELS
        # Gauss-Newton steps: b = sum g I over the patch at the present position (bilinear)
        u0, v0 = uv[k, 0], uv[k, 1]
        u, v = u0, v0
        good = True
        sit = sii = np.float32(0)
        gain = np.float32(1)
        for _ in range(iterations):
            j0, i0 = int(np.floor(u)), int(np.floor(v))
            if i0 < _HALF or j0 < _HALF or i0 + _HALF + 1 >= height or j0 + _HALF + 1 >= width:
                good = False
                break
            a, b = np.float32(u - j0), np.float32(v - i0)
            w00, w01, w10, w11 = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
            bx = by = si = np.float32(0)
            sit = sii = np.float32(0)
            m = 0
            for y in range(-_HALF, _HALF + 1):
                row0, row1 = image[i0 + y], image[i0 + y + 1]
                for x in range(j0 - _HALF, j0 + _HALF + 1):
                    value = w00 * row0[x] + w01 * row0[x + 1] + w10 * row1[x] + w11 * row1[x + 1]
                    bx += gx[m] * value
                    by += gy[m] * value
                    sit += T[m] * value
                    si += value
                    sii += value * value
                    m += 1
            sii -= si * si / _PIXELS
            gain = sit / stt
            if gain < least_gain:
                good = False
                break
            du = -(hyy * bx - hxy * by) / determinant / gain
            dv = -(hxx * by - hxy * bx) / determinant / gain
            u += du
            v += dv
            if abs(u - u0) > limit_px or abs(v - v0) > limit_px:
                good = False
                break
            if du * du + dv * dv < converged_px2:
                break
        # sit / sqrt(sii stt) is the normalised cross-correlation, inv(H) / gain^2 the position's covariance
        if good and sii > 0:
            uv[k, 0], uv[k, 1] = u, v
            score[k] = sit / np.sqrt(sii * stt)
            scale = 1.0 / (gain * gain * determinant)
            covariance[k, 0] = hyy * scale
            covariance[k, 1] = -hxy * scale
            covariance[k, 2] = hxx * scale
    return score, covariance
