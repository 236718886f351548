"""What a frame measures of a feature: its ray and inverse depth at the middle row's time, with covariance.

Inverse depth is what a Kinect measures (disparity): there its noise is nearly Gaussian and independent of the pixel's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.frontend.camera.lens import ray_at
from odom.frontend.camera.rolling_shutter import point_flow
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.depth_plane import PLANE_LIMITS, read_planes
from odom.frontend.features.view import View
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled

_LOOKS = 3
"""Looks at a depth image that was taken from beside: each finds the place by the depth found at the one before."""
_UNKNOWN_INVERSE_DEPTH = 0.5
"""1/m; how a feature without depth moves in the image is reckoned as if it were so far away."""


@dataclass(frozen=True, eq=False)
class Measurements:
    """n features of one frame.

    `values` (n x 3): x/z, y/z and 1/z (1/m; NaN: depth not measured) in the colour camera at its middle row's time.
    `jacobian_timing` (n x 3 x 3): their derivative by the vector of the `ShutterTiming`. `covariance` (n x 4): the
    entries xx, xy, yy of the ray's and the variance of the inverse depth. `slope` (n x 2): inverse depth per pixel in
    u, v.
    """

    values: Array
    jacobian_timing: Array
    covariance: Array
    slope: Array

    @classmethod
    def nothing(cls) -> "Measurements":
        """Return the measurements of no feature."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 4)), np.zeros((0, 2)))

    def __len__(self) -> int:
        return len(self.values)

    def take(self, rows: Mask | Index) -> "Measurements":
        """Return the chosen rows."""
        chosen = np.flatnonzero(rows) if rows.dtype == np.bool_ else rows
        return Measurements(
            self.values.take(chosen, 0),
            self.jacobian_timing.take(chosen, 0),
            self.covariance.take(chosen, 0),
            self.slope.take(chosen, 0),
        )

    def joined(self, other: "Measurements") -> "Measurements":
        """Return these measurements followed by the `other` ones."""
        return Measurements(
            np.concatenate([self.values, other.values]),
            np.concatenate([self.jacobian_timing, other.jacobian_timing]),
            np.concatenate([self.covariance, other.covariance]),
            np.concatenate([self.slope, other.slope]),
        )

    def retimed(self, change: Array) -> Array:
        """Return `values` (n x 3) as they would be after the timing's vector has changed by `change` (3, s)."""
        return np.asarray(self.values + self.jacobian_timing @ change)


def points_of(measurements: Measurements, share_of_ray: float = 1.0) -> tuple[Array, Array]:
    """Return the points (n x 3, m, camera frame) of features with depth, and their covariances (n x 3 x 3, m^2).

    `share_of_ray` scales the variance across the ray.
    """
    return _points_of(measurements.values, measurements.covariance, share_of_ray)


@compiled
def _points_of(values: Array, covariance: Array, share_of_ray: float) -> tuple[Array, Array]:
    """Return points and covariances as `points_of` does: J S J' with the derivative J of (x z, y z, z), z = 1 / w."""
    n = values.shape[0]
    points, covariances = np.empty((n, 3)), np.empty((n, 3, 3))
    for k in range(n):
        x, y, z = values[k, 0], values[k, 1], 1.0 / values[k, 2]
        points[k, 0], points[k, 1], points[k, 2] = x * z, y * z, z
        across = z * z * share_of_ray
        along = z**4 * covariance[k, 3]
        C = covariances[k]
        C[0, 0] = across * covariance[k, 0] + x * x * along
        C[0, 1] = across * covariance[k, 1] + x * y * along
        C[1, 1] = across * covariance[k, 2] + y * y * along
        C[0, 2], C[1, 2], C[2, 2] = x * along, y * along, along
        C[1, 0], C[2, 0], C[2, 1] = C[0, 1], C[0, 2], C[1, 2]
    return points, covariances


@compiled
def _depth_errors(uv: Array, width: int, height: int, model: Array) -> Array:
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
def _moving(
    rays: NDArray[np.float32],
    intrinsics: Array,
    uv: Array,
    near: Array,
    twist: Array,
    depth_delay_s: float,
    readout_s: float,
    depth_readout_s: float,
    model: Array,
) -> tuple[Array, Array]:
    """Return rays (n x 2) with their rates and that of inverse depth (n x 5 together), and where to read depth (n x 2).

    `near` (n, 1/m) are inverse depths, about. The depth is read at the pixel where the feature was when its row of the
    depth image was taken.
    """
    height = rays.shape[0]
    n = uv.shape[0]
    flow, places = np.empty((n, 5)), np.empty((n, 2))
    for k in range(n):
        u, v = uv[k, 0], uv[k, 1]
        x, y = ray_at(rays, u, v)
        xd, yd, wd = point_flow(x, y, near[k], twist)
        since_seen_s = depth_delay_s + (v / height - 0.5) * (depth_readout_s - readout_s)
        flow[k, 0], flow[k, 1], flow[k, 2], flow[k, 3], flow[k, 4] = x, y, xd, yd, wd
        places[k, 0] = u + xd * intrinsics[0] * since_seen_s - model[0] - model[2] * near[k]
        places[k, 1] = v + yd * intrinsics[1] * since_seen_s - model[1] - model[3] * near[k]
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
def _carried(
    flow: Array,
    planes: Array,
    errors: Array,
    intrinsics: Array,
    uv: Array,
    covariance_uv: Array,
    pixel_variance: float,
    depth_noise: Array,
    height: int,
    depth_delay_s: float,
    readout_s: float,
    depth_readout_s: float,
) -> tuple[Array, Array, Array, Array]:
    """Return values, their derivative by the timing, covariance and slopes (see `Measurements`).

    `flow` is as from `_moving`, `planes` (n x 3) were read in the depth image, which errs by `errors` (n x 2, see
    `_depth_errors`); `depth_noise` is the table of the `FeatureNoise`.
    """
    n = uv.shape[0]
    values, jacobian = np.empty((n, 3)), np.zeros((n, 3, 3))
    covariance, slope = np.empty((n, 4)), np.zeros((n, 2))
    fx, fy = intrinsics[0], intrinsics[1]
    for k in range(n):
        x, y, xd, yd, wd = flow[k, 0], flow[k, 1], flow[k, 2], flow[k, 3], flow[k, 4]
        offset, scale = errors[k, 0], errors[k, 1]
        w, su, sv = (planes[k, 0] - offset) / scale, planes[k, 1] / scale, planes[k, 2] / scale
        # ray and depth are carried from the time of their rows to that of the colour image's middle row
        row = uv[k, 1] / height - 0.5
        values[k, 0] = x - xd * row * readout_s
        values[k, 1] = y - yd * row * readout_s
        values[k, 2] = w - wd * (depth_delay_s + row * depth_readout_s)
        jacobian[k, 0, 0] = -xd * row
        jacobian[k, 1, 0] = -yd * row
        if w > 0.0:
            jacobian[k, 2, 1] = su * xd * fx + sv * yd * fy - wd
            jacobian[k, 2, 0] = (0.5 - row) * jacobian[k, 2, 1] - wd * row
            jacobian[k, 2, 2] = row * jacobian[k, 2, 1]
            slope[k, 0], slope[k, 1] = su, sv
        covariance[k, 0] = (covariance_uv[k, 0] + pixel_variance) / (fx * fx)
        covariance[k, 1] = covariance_uv[k, 1] / (fx * fy)
        covariance[k, 2] = (covariance_uv[k, 2] + pixel_variance) / (fy * fy)
        covariance[k, 3] = sigma_at(depth_noise, values[k, 2]) ** 2
    return values, jacobian, covariance, slope


def measure(
    view: View,
    sensor: SensorModel,
    uv: Array,
    covariance_uv: Array,
    twist: Array,
    inverse_depth_guess: Array | None = None,
) -> Measurements:
    """Measure the features at `uv` (n x 2 px) of a frame, seen by a camera moving with `twist` (6, SI, its own frame).

    `covariance_uv` (n x 3 px^2: uu, uv, vv) is that of the positions; the sensor's noise is added.
    `inverse_depth_guess` (n, 1/m) says about where they are, which saves one look at the depth image.
    """
    lens, timing, noise = sensor.lens, sensor.timing, sensor.noise.noise
    height, width = view.depth_mm.shape
    errors = _depth_errors(uv, width, height, lens.depth_model)
    if inverse_depth_guess is None:
        near = _looked_up(view.depth_mm, uv, errors, lens.depth_model)
    else:
        near = inverse_depth_guess
    delay_s = view.depth_delay_s + timing.depth_lag_s + timing.readout_s / 2.0
    flow, places = _moving(
        lens.rays, lens.intrinsics, uv, near, twist, delay_s, timing.readout_s, timing.depth_readout_s, lens.depth_model
    )
    planes = read_planes(view.depth_mm, places, PLANE_LIMITS)
    return Measurements(
        *_carried(
            flow,
            planes,
            errors,
            lens.intrinsics,
            uv,
            covariance_uv,
            noise.pixel_sigma**2,
            noise.inverse_depth_sigma,
            height,
            delay_s,
            timing.readout_s,
            timing.depth_readout_s,
        )
    )


def _looked_up(depth_mm: NDArray[np.uint16], uv: Array, errors: Array, model: Array) -> Array:
    """Return the inverse depth (n, 1/m) about at features, as the depth image shows it; that of 2 m where it does not.

    Where a feature lies in a depth image that was taken from beside depends on how far it is, which is looked up there.
    """
    near = np.full(len(uv), _UNKNOWN_INVERSE_DEPTH)
    for _ in range(_LOOKS if model[2:4].any() else 1):
        places = uv - model[0:2] - near[:, None] * model[2:4]
        seen = (read_planes(depth_mm, places, PLANE_LIMITS)[:, 0] - errors[:, 0]) / errors[:, 1]
        near = np.where(seen > 0.0, seen, _UNKNOWN_INVERSE_DEPTH)
    return near
