"""What a frame measures of a feature: its ray and inverse depth at the middle row's time, with covariance.

Inverse depth is what a Kinect measures (disparity): there its noise is nearly Gaussian and independent of the pixel's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.frontend.camera.lens import ray_at
from odom.frontend.camera.rolling_shutter import point_flow
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.depth_plane import PLANE_LIMITS, read_plane
from odom.frontend.features.view import View
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled

_LOOKS = 3
"""Looks at a depth image that was taken from beside: each finds the place by the depth found at the one before."""


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
        return Measurements(self.values[rows], self.jacobian_timing[rows], self.covariance[rows], self.slope[rows])

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
    x, y, w = measurements.values.T
    z = 1.0 / w
    J = np.zeros((len(z), 3, 3))
    J[:, 0, 0] = J[:, 1, 1] = z
    J[:, 0, 2], J[:, 1, 2], J[:, 2, 2] = -x * z * z, -y * z * z, -z * z
    S = np.zeros((len(z), 3, 3))
    S[:, 0, 0], S[:, 1, 1] = measurements.covariance[:, 0] * share_of_ray, measurements.covariance[:, 2] * share_of_ray
    S[:, 0, 1] = S[:, 1, 0] = measurements.covariance[:, 1] * share_of_ray
    S[:, 2, 2] = measurements.covariance[:, 3]
    return np.column_stack([x * z, y * z, z]), J @ S @ J.transpose(0, 2, 1)


@compiled
def _measure(
    depth_mm: NDArray[np.uint16],
    rays: NDArray[np.float32],
    intrinsics: Array,
    uv: Array,
    inverse_depth_guess: Array,
    twist: Array,
    depth_delay_s: float,
    readout_s: float,
    depth_readout_s: float,
    depth_model: Array,
    plane_limits: tuple[float, float, float],
) -> tuple[Array, Array, Array]:
    """Return values (n x 3), their derivative by the timing (n x 3 x 3) and slopes (n x 2): see `Measurements`."""
    height, width = depth_mm.shape
    m = depth_model
    n = uv.shape[0]
    values = np.empty((n, 3))
    jacobian = np.zeros((n, 3, 3))
    slope = np.zeros((n, 2))
    for k in range(n):
        u, v = uv[k, 0], uv[k, 1]
        x, y = ray_at(rays, u, v)
        # inverse depth as measured is offset + scale times the true one, both fields over the image
        a, b = (u - (width - 1) / 2) / (width / 2), (v - (height - 1) / 2) / (width / 2)
        offset = m[4] + m[5] * a + m[6] * b + m[7] * a * a + m[8] * a * b + m[9] * b * b
        scale = m[10] + m[11] * a + m[12] * b + m[13] * a * a + m[14] * a * b + m[15] * b * b
        # how the feature moves in the image; without any depth it is taken to be 2 m away
        guess = inverse_depth_guess[k]
        if not guess > 0.0:
            # where it lies in the depth image depends on how far it is, which is looked up there
            guess = 0.5
            for _ in range(_LOOKS if m[2] != 0.0 or m[3] != 0.0 else 1):
                seen = read_plane(depth_mm, u - m[0] - m[2] * guess, v - m[1] - m[3] * guess, plane_limits)[0]
                guess = (seen - offset) / scale
                if not guess > 0.0:
                    break
        near = guess if guess > 0.0 else 0.5
        xd, yd, wd = point_flow(x, y, near, twist)
        # the depth is read at the pixel where the feature was when its row of the depth image was taken
        row = v / height - 0.5
        since_seen_s = depth_delay_s + row * (depth_readout_s - readout_s)
        w, su, sv = read_plane(
            depth_mm,
            u + xd * intrinsics[0] * since_seen_s - m[0] - m[2] * near,
            v + yd * intrinsics[1] * since_seen_s - m[1] - m[3] * near,
            plane_limits,
        )
        w, su, sv = (w - offset) / scale, su / scale, sv / scale
        # ray and depth are carried from the time of their rows to that of the colour image's middle row
        values[k, 0] = x - xd * row * readout_s
        values[k, 1] = y - yd * row * readout_s
        values[k, 2] = w - wd * (depth_delay_s + row * depth_readout_s)
        jacobian[k, 0, 0] = -xd * row
        jacobian[k, 1, 0] = -yd * row
        if w > 0.0:
            jacobian[k, 2, 1] = su * xd * intrinsics[0] + sv * yd * intrinsics[1] - wd
            jacobian[k, 2, 0] = (0.5 - row) * jacobian[k, 2, 1] - wd * row
            jacobian[k, 2, 2] = row * jacobian[k, 2, 1]
            slope[k, 0], slope[k, 1] = su, sv
    return values, jacobian, slope


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
    `inverse_depth_guess` (n, 1/m, NaN where unknown) saves one look at the depth image.
    """
    guess = np.full(len(uv), np.nan) if inverse_depth_guess is None else inverse_depth_guess
    lens, timing, noise = sensor.lens, sensor.timing, sensor.noise.noise
    values, jacobian, slope = _measure(
        view.depth_mm,
        lens.rays,
        lens.intrinsics,
        uv,
        guess,
        twist,
        view.depth_delay_s + timing.depth_lag_s + timing.readout_s / 2.0,
        timing.readout_s,
        timing.depth_readout_s,
        lens.depth_model,
        PLANE_LIMITS,
    )
    fx, fy = lens.intrinsics[:2]
    covariance = np.empty((len(uv), 4))
    covariance[:, 0] = (covariance_uv[:, 0] + noise.pixel_sigma**2) / fx**2
    covariance[:, 1] = covariance_uv[:, 1] / (fx * fy)
    covariance[:, 2] = (covariance_uv[:, 2] + noise.pixel_sigma**2) / fy**2
    covariance[:, 3] = np.interp(values[:, 2], noise.inverse_depth_sigma[0], noise.inverse_depth_sigma[1]) ** 2
    return Measurements(values, jacobian, covariance, slope)
