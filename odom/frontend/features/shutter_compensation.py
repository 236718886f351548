"""Features seen in motion: where a rolling shutter shows them, and how they are carried to the middle row's time."""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.camera.lens import Lens, ahead, in_numbers, pixel_of, ray_at
from odom.frontend.camera.rolling_shutter import point_flow
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

_ROW_STEPS = 4
"""Newton's steps to the row that shows a point: at 6 rad/s they leave less than a hundredth of a pixel on average."""
_LANES = 64
"""Points of a block: a constant, so that the compiler sees that the rows of a block do not overlap."""
_LEAST_SLOPE = 0.1
"""Least derivative that a Newton step divides by: it would be 0 for a point that moves along with the readout."""


@compiled
def _find_rows(
    block: Array,
    intrinsics: tuple[float, ...],
    projection: tuple[float, ...],
    height: float,
    twist: tuple[float, ...],
    readout_s: float,
) -> None:
    """Take a block of points one Newton step nearer to the rows that show them.

    The block has six rows of `_LANES` numbers: x/z, y/z and z as the middle row shows them, x/z and y/z as their own
    row shows them, and how much later than the middle one that is read (s).
    """
    latest_s = 0.5 * abs(readout_s)
    for k in range(_LANES):
        x, y, row_s = block[k + 3 * _LANES], block[k + 4 * _LANES], block[k + 5 * _LANES]
        _u, v = pixel_of(x, y, intrinsics, projection)
        xd, yd, _wd = point_flow(x, y, 1.0 / block[k + 2 * _LANES], twist)
        late_s = (v / height - 0.5) * readout_s - row_s
        slope = 1.0 - yd * intrinsics[1] * readout_s / height
        row_s += late_s / (slope if slope > _LEAST_SLOPE else _LEAST_SLOPE)
        row_s = row_s if row_s > -latest_s else -latest_s
        row_s = row_s if row_s < latest_s else latest_s
        block[k + 3 * _LANES], block[k + 4 * _LANES] = block[k] + xd * row_s, block[k + _LANES] + yd * row_s
        block[k + 5 * _LANES] = row_s


def seen_in_motion(
    points: Array, T_camera_points: Array, lens: Lens, twist: Array, readout_s: float, margin_px: float
) -> Array:
    """Return (n x 3): pixel u, v of `points` (n x 3) as a rolling shutter shows them, and their depth z.

    `T_camera_points` and z are those at the middle row's time; the camera moves with `twist` (6, SI). NaN where not in
    the image less `margin_px`. The row in which a point is seen depends on the time, and the time on the row: Newton's
    steps find both. `carried` takes these pixels back to where the middle row would have shown the points.
    """
    height, width = lens.rays.shape[:2]
    of_lens = lens.intrinsics, lens.projection, width, height
    return _seen_in_motion(points, T_camera_points, *of_lens, margin_px, twist, readout_s)


@compiled
def _seen_in_motion(
    points: Array,
    T_camera_points: Array,
    intrinsics: Array,
    projection: Array,
    width: int,
    height: int,
    margin: float,
    twist: Array,
    readout_s: float,
) -> Array:
    """Return pixels and depths as `seen_in_motion` does, a block of points at a time."""
    n = points.shape[0]
    out = np.full((n, 3), np.nan)
    intrinsics_, projection_ = in_numbers(intrinsics, projection)
    velocity = twist[0], twist[1], twist[2], twist[3], twist[4], twist[5]
    block = np.zeros(6 * _LANES)
    for first in range(0, n, _LANES):
        count = min(_LANES, n - first)
        for k in range(count):
            x, y, z = ahead(T_camera_points, points, first + k)
            block[k], block[k + _LANES], block[k + 2 * _LANES] = x, y, z
            block[k + 3 * _LANES], block[k + 4 * _LANES], block[k + 5 * _LANES] = x, y, 0.0
        for _ in range(_ROW_STEPS if readout_s != 0.0 else 0):
            _find_rows(block, intrinsics_, projection_, float(height), velocity, readout_s)
        for k in range(count):
            u, v = pixel_of(block[k + 3 * _LANES], block[k + 4 * _LANES], intrinsics_, projection_)
            z = block[k + 2 * _LANES]
            if z > 0.0 and margin <= u <= width - 1 - margin and margin <= v <= height - 1 - margin:
                out[first + k, 0], out[first + k, 1], out[first + k, 2] = u, v, z
    return out


@compiled
def middle_rays(rays: NDArray[np.float32], uv: Array, near: Array, twist: Array, readout_s: float) -> Array:
    """Return the rays (n x 2) of pixels `uv` (n x 2) as the middle row of a camera moving with `twist` would show them.

    `near` (n, 1/m) are rough inverse depths.
    """
    out = np.empty((uv.shape[0], 2))
    for k in range(uv.shape[0]):
        x, y = ray_at(rays, uv[k, 0], uv[k, 1])
        xd, yd, _wd = point_flow(x, y, near[k], twist)
        row_s = (uv[k, 1] / rays.shape[0] - 0.5) * readout_s
        out[k, 0], out[k, 1] = x - xd * row_s, y - yd * row_s
    return out


@compiled
def depth_errors(uv: Array, width: int, height: int, model: Array) -> Array:
    """Return offset and scale (n x 2) at pixels `uv`: inverse depth as measured is offset + scale times the true one.

    Both are fields over the image (see `DepthModel`, whose vector `model` is).
    """
    m = model
    out = np.empty((uv.shape[0], 2))
    for k in range(uv.shape[0]):
        a, b = (uv[k, 0] - (width - 1) / 2) / (width / 2), (uv[k, 1] - (height - 1) / 2) / (width / 2)
        out[k, 0] = m[4] + m[5] * a + m[6] * b + m[7] * a * a + m[8] * a * b + m[9] * b * b
        out[k, 1] = m[10] + m[11] * a + m[12] * b + m[13] * a * a + m[14] * a * b + m[15] * b * b
    return out


@compiled
def flow_and_places(
    rays: NDArray[np.float32],
    intrinsics: Array,
    uv: Array,
    near: Array,
    twist: Array,
    times_s: tuple[float, float, float],
    model: Array,
) -> tuple[Array, Array]:
    """Return rays, their rates and that of inverse depth (n x 5), and the pixels where depth is to be read (n x 2).

    `near` (n, 1/m) are rough inverse depths. The depth is read at the pixel where the feature was when its row of the
    depth image was taken. `times_s`: how much later than the colour image's middle row that of the depth image was
    taken, and the readouts of colour and depth.
    """
    depth_delay_s, readout_s, depth_readout_s = times_s
    height, width = rays.shape[:2]
    n = uv.shape[0]
    flow, places = np.empty((n, 5)), np.empty((n, 2))
    for k in range(n):
        u, v = uv[k, 0], uv[k, 1]
        x, y = ray_at(rays, u, v)
        xd, yd, wd = point_flow(x, y, near[k], twist)
        since_seen_s = depth_delay_s + (v / height - 0.5) * (depth_readout_s - readout_s)
        flow[k, 0], flow[k, 1], flow[k, 2], flow[k, 3], flow[k, 4] = x, y, xd, yd, wd
        aside_u = model[0] + model[2] * near[k] + model[16] * (u - 0.5 * (width - 1))
        aside_v = model[1] + model[3] * near[k] + model[17] * (v - 0.5 * (height - 1))
        places[k, 0] = u + xd * intrinsics[0] * since_seen_s - aside_u
        places[k, 1] = v + yd * intrinsics[1] * since_seen_s - aside_v
    return flow, places


@compiled
def sigma_at(table: Array, inverse_depth: float) -> float:
    """Return one sigma of an inverse depth (1/m) by the `table` of a `FeatureNoise`, as `np.interp` does."""
    w, last = inverse_depth, table.shape[1] - 1
    if not w > table[0, 0]:
        return float(table[1, 0]) if w <= table[0, 0] else np.nan
    for k in range(last):
        if w <= table[0, k + 1]:
            share = (w - table[0, k]) / (table[0, k + 1] - table[0, k])
            return float(table[1, k] + share * (table[1, k + 1] - table[1, k]))
    return float(table[1, last])


@compiled
def carried(
    flow: Array,
    planes: Array,
    errors: Array,
    intrinsics: Array,
    uv: Array,
    covariance_uv: Array,
    pixel_variance: float,
    depth_noise: Array,
    height: int,
    times_s: tuple[float, float, float],
) -> tuple[Array, Array, Array, Array]:
    """Return values, their derivative by the timing, covariance and slopes (see `Measurements`).

    `flow` and `times_s` are those of `flow_and_places`, `planes` (n x 3) were read in the depth image, which errs by
    `errors` (n x 2, see `depth_errors`); `depth_noise` is the table of the `FeatureNoise`.
    """
    depth_delay_s, readout_s, depth_readout_s = times_s
    n = uv.shape[0]
    values, jacobian = np.empty((n, 3)), np.zeros((n, 3, 3))
    covariance, slope = np.empty((n, 4)), np.zeros((n, 2))
    fx, fy = intrinsics[0], intrinsics[1]
    half = 0.5 if readout_s >= 0.0 else -0.5
    for k in range(n):
        x, y, xd, yd, wd = flow[k, 0], flow[k, 1], flow[k, 2], flow[k, 3], flow[k, 4]
        offset, scale = errors[k, 0], errors[k, 1]
        w, su, sv = (planes[k, 0] - offset) / scale, planes[k, 1] / scale, planes[k, 2] / scale
        # ray and depth are carried from the time of their rows to that of the colour image's middle row
        row = uv[k, 1] / height - 0.5
        values[k, 0] = x - xd * row * readout_s
        values[k, 1] = y - yd * row * readout_s
        values[k, 2] = w - wd * (depth_delay_s + row * depth_readout_s)
        # derivatives by the timing: 0 the colour image's readout, 1 the lag of depth, 2 the depth image's readout
        jacobian[k, 0, 0] = -xd * row
        jacobian[k, 1, 0] = -yd * row
        if w > 0.0:
            jacobian[k, 2, 1] = su * xd * fx + sv * yd * fy - wd
            jacobian[k, 2, 0] = (half - row) * jacobian[k, 2, 1] - wd * row
            jacobian[k, 2, 2] = row * jacobian[k, 2, 1]
            slope[k, 0], slope[k, 1] = su, sv
        # pixel noise as the ray's, and the variance of inverse depth
        covariance[k, 0] = (covariance_uv[k, 0] + pixel_variance) / (fx * fx)
        covariance[k, 1] = covariance_uv[k, 1] / (fx * fy)
        covariance[k, 2] = (covariance_uv[k, 2] + pixel_variance) / (fy * fy)
        covariance[k, 3] = sigma_at(depth_noise, values[k, 2]) ** 2
    return values, jacobian, covariance, slope
