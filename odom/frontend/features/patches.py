"""Small image patches: cut at a key frame's corners, found again at sub-pixel precision in another image.

The reference patch is warped by the homography that the predicted pose and the surface imply, then aligned in
translation, gain and offset (inverse compositional Gauss-Newton: S. Baker, I. Matthews, IJCV 56, 2004).
"""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.features.tuning import TUNING
from odom.geometry.arrays import Array, Image, Index, Mask
from odom.geometry.compiled import compiled, vectorised

RADIUS = 12
"""A stored patch is (2 RADIUS + 1) pixels square: an aligned one turned by 45 degrees and magnified by half fits in."""
_HALF = 5
"""An aligned patch is (2 _HALF + 1) = 11 pixels square; smaller ones are ambiguous, larger ones cost more and bend."""
_ROWS, _ROW, _BORDERED = 2 * _HALF + 1, 2 * _HALF + 2, 2 * _HALF + 3
"""Rows of an aligned patch; pixels of a row with the one that interpolation needs; rows with a border on both sides."""
_PIXELS = _ROWS**2
"""Pixels of an aligned patch."""
_LEAST_DETERMINANT = 1e-3
"""Determinant of the structure tensor over its squared trace; a patch with less is an edge and slides along itself."""
UNWARPED = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
"""The homography of a patch that is seen as it was."""
PATCH_LIMITS = (TUNING.patch_least_contrast, TUNING.patch_least_gain, TUNING.patch_converged_px**2)
"""What `align_patches` demands of a patch and its alignment."""


@compiled
def cut_patches(image: Image, uv: Array) -> Image:
    """Return n patches (n, 2 RADIUS + 1, 2 RADIUS + 1) uint8 centred exactly on `uv`, clamped at the border."""
    height, width = image.shape
    n = uv.shape[0]
    size = 2 * RADIUS + 1
    out = np.empty((n, size, size), np.uint8)
    columns, shares = np.empty(size, np.int64), np.empty(size)
    for k in range(n):
        for x in range(size):
            u = min(max(uv[k, 0] + x - RADIUS, 0.0), width - 1.001)
            columns[x] = int(u)
            shares[x] = u - columns[x]
        for y in range(size):
            v = min(max(uv[k, 1] + y - RADIUS, 0.0), height - 1.001)
            i = int(v)
            b = v - i
            for x in range(size):
                j, a = columns[x], shares[x]
                out[k, y, x] = np.rint(
                    (1 - b) * ((1 - a) * image[i, j] + a * image[i, j + 1])
                    + b * ((1 - a) * image[i + 1, j] + a * image[i + 1, j + 1])
                )
    return out


@vectorised
def align_patches(
    image: Image,
    patches: Image,
    rows: Index,
    H_reference_current: Array,
    uv: Array,
    valid: Mask,
    iterations: int,
    limit_px: float,
    limits: tuple[float, float, float],
) -> tuple[NDArray[np.float32], Array]:
    """Align each `valid` one of n `patches[rows]` in `image` from the start `uv` (n x 2 px of it, changed in place).

    `H_reference_current` (n x 3 x 2) maps an offset in `image` to one in the patch (see `homographies`). `limits` (see
    `PATCH_LIMITS`) are the least variance of a patch (grey^2), the least gain, and the square of the step at which it
    has converged (px^2).

    Returns (n,) the normalised cross-correlation, 0 where the alignment left `limit_px` around the start, the image, or
    the patch; and (n x 3) the covariance (uu, uv, vv in px^2) for one grey level of image noise, by the structure
    tensor. With template T, gradient g and image I the step solves H du = -sum g (I - gain T - offset) / gain, where g
    was made orthogonal to T and to 1, so that gain and offset need not be estimated (Baker, Matthews, 2004, part 3).

    Buffers hold a patch row by row, with one more pixel in each row for the interpolation: all loops but those that
    read pixels run over whole buffers, several pixels at a time. `inside` is 0 for what does not belong to the patch.
    """
    least_variance, least_gain, converged_px2 = limits
    height, width = image.shape
    n = uv.shape[0]
    score = np.zeros(n, np.float32)
    covariance = np.zeros((n, 3))
    pixels, radius, half, one = np.float32(_PIXELS), np.float32(RADIUS), np.float32(0.5), np.float32(1)
    size = np.int32(2 * RADIUS + 1)
    inside = np.zeros(_ROWS * _ROW, np.float32)
    for y in range(_ROWS):
        inside[y * _ROW : y * _ROW + _ROWS] = np.float32(1)
    T, gx, gy = np.zeros_like(inside), np.zeros_like(inside), np.zeros_like(inside)
    # the template with a border of one pixel: offsets, place in the patch, weights, and the four neighbours there
    border = np.arange(_BORDERED * _BORDERED)
    dx = (border % _BORDERED - _HALF - 1).astype(np.float32)
    dy = (border // _BORDERED - _HALF - 1).astype(np.float32)
    warped, a_at, b_at = np.zeros_like(dx), np.zeros_like(dx), np.zeros_like(dx)
    p00, p01, p10, p11 = np.zeros_like(dx), np.zeros_like(dx), np.zeros_like(dx), np.zeros_like(dx)
    place = np.zeros(len(dx), np.int32)
    right, below, across = np.uint32(1), np.uint32(size), np.uint32(size + 1)
    # the image under the patch, and the same between its columns; a row and a pixel more than is used
    seen, between = np.zeros((_ROWS + 1) * _ROW + 1, np.float32), np.zeros((_ROWS + 1) * _ROW, np.float32)
    for k in range(n):
        if not valid[k]:
            continue
        a00, a01 = np.float32(H_reference_current[k, 0, 0]), np.float32(H_reference_current[k, 0, 1])
        a10, a11 = np.float32(H_reference_current[k, 1, 0]), np.float32(H_reference_current[k, 1, 1])
        h0, h1 = np.float32(H_reference_current[k, 2, 0]), np.float32(H_reference_current[k, 2, 1])
        reach = (_HALF + 1) * max(abs(a00) + abs(a01), abs(a10) + abs(a11))
        nearest = 1.0 - (_HALF + 1) * (abs(h0) + abs(h1))
        if not reach <= (RADIUS - 0.01) * nearest:
            continue
        # the reference patch as the predicted pose shows it (bilinear)
        patch = patches[rows[k]].reshape(-1)
        for m in range(len(dx)):
            share = one / (one + h0 * dx[m] + h1 * dy[m])
            u, v = (a00 * dx[m] + a01 * dy[m]) * share + radius, (a10 * dx[m] + a11 * dy[m]) * share + radius
            j, i = np.int32(u), np.int32(v)
            a_at[m], b_at[m], place[m] = u - np.float32(j), v - np.float32(i), i * size + j
        for m in range(len(dx)):
            q = np.uint32(place[m])
            p00[m], p01[m], p10[m], p11[m] = patch[q], patch[q + right], patch[q + below], patch[q + across]
        for m in range(len(dx)):
            top = p00[m] + a_at[m] * (p01[m] - p00[m])
            warped[m] = top + b_at[m] * (p10[m] + a_at[m] * (p11[m] - p10[m]) - top)
        # template T without its mean, its gradient, and the sums of their products
        for y in range(_ROWS):
            above = warped[y * _BORDERED : (y + 1) * _BORDERED]
            here = warped[(y + 1) * _BORDERED : (y + 2) * _BORDERED]
            under = warped[(y + 2) * _BORDERED : (y + 3) * _BORDERED]
            row = slice(y * _ROW, (y + 1) * _ROW)
            T_row, gx_row, gy_row = T[row], gx[row], gy[row]
            for x in range(_ROWS):
                T_row[x] = here[x + 1]
                gx_row[x] = half * (here[x + 2] - here[x])
                gy_row[x] = half * (under[x + 1] - above[x + 1])
        mean = T.sum() / pixels
        sxx = sxy = syy = sxt = syt = sx = sy = stt = np.float32(0)
        for m in range(len(T)):
            T[m] = (T[m] - mean) * inside[m]
            sxx += gx[m] * gx[m]
            sxy += gx[m] * gy[m]
            syy += gy[m] * gy[m]
            sxt += gx[m] * T[m]
            syt += gy[m] * T[m]
            sx += gx[m]
            sy += gy[m]
            stt += T[m] * T[m]
        if stt < least_variance * _PIXELS:
            continue
        # gain and offset are eliminated: gradients are made orthogonal to T and to 1; h is the Hessian that remains
        hxx = sxx - sxt * sxt / stt - sx * sx / pixels
        hxy = sxy - sxt * syt / stt - sx * sy / pixels
        hyy = syy - syt * syt / stt - sy * sy / pixels
        determinant = hxx * hyy - hxy * hxy
        if determinant < _LEAST_DETERMINANT * (hxx + hyy) * (hxx + hyy) or determinant <= 0:
            continue
        along_x, along_y, mean_x, mean_y = sxt / stt, syt / stt, sx / pixels, sy / pixels
        for m in range(len(T)):
            gx[m] -= (along_x * T[m] + mean_x) * inside[m]
            gy[m] -= (along_y * T[m] + mean_y) * inside[m]
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
            for y in range(_ROWS + 1):
                pixel_row = image[i0 - _HALF + y, j0 - _HALF : j0 + _HALF + 2]
                seen_row = seen[y * _ROW : (y + 1) * _ROW]
                for x in range(_ROW):
                    seen_row[x] = pixel_row[x]
            for m in range(len(between)):
                between[m] = seen[m] + a * (seen[m + 1] - seen[m])
            bx = by = si = np.float32(0)
            sit = sii = np.float32(0)
            for m in range(len(T)):
                value = (between[m] + b * (between[m + _ROW] - between[m])) * inside[m]
                bx += gx[m] * value
                by += gy[m] * value
                sit += T[m] * value
                si += value
                sii += value * value
            sii -= si * si / pixels
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
