"""What a frame measures of a feature: its ray and inverse depth at the middle row's time, with covariance.

Inverse depth is what a Kinect measures (disparity): there its noise is nearly Gaussian and independent of the pixel's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.frame.depth_model import aside_px
from odom.frontend.camera.depth_tilt import without_tilt
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.depth_plane import PLANE_LIMITS, read_planes
from odom.frontend.features.shutter_compensation import carried, depth_errors, flow_and_places
from odom.frontend.features.view import View
from odom.geometry.arrays import Array, Index, Mask, rounded
from odom.geometry.compiled import compiled

_LOOKS = 3
"""Readings of a depth image of a camera beside the colour one: each finds the pixel by the depth of the one before."""
_UNKNOWN_INVERSE_DEPTH = 0.5
"""1/m; a feature without depth is assumed to move in the image as if it were this far away."""


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

    def rounded(self) -> "Measurements":
        """Return them with all but their values in numbers of 24 bits."""
        return Measurements(self.values, rounded(self.jacobian_timing), rounded(self.covariance), rounded(self.slope))

    def straight(self, angles: Array) -> "Measurements":
        """Return them with a tilt of depth by `angles` (2, rad) taken out."""
        values = without_tilt(self.values, angles)
        return self if values is self.values else replace(self, values=values)

    def retimed(self, change: Array) -> "Measurements":
        """Return them by a timing whose vector has changed by `change` (3 or n x 3, s)."""
        return replace(self, values=self.values + (self.jacobian_timing @ change[..., None])[..., 0])

    def by_one_timing(self, timings: Sequence[ShutterTiming], frame: Index, timing: ShutterTiming) -> "Measurements":
        """Return what frames measured by `timings` (K) of their own as measured by one; `frame` (n) counts the frames.

        The derivatives are by changes of that `timing`.
        """
        retimed = self.retimed(np.array([own.change_to(timing) for own in timings])[frame])
        by_change = np.array([own.by_change_of(timing) for own in timings])[frame]
        return replace(retimed, jacobian_timing=self.jacobian_timing @ by_change)


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
    `inverse_depth_guess` (n, 1/m) is roughly their inverse depth, which saves reading the depth image once.
    """
    lens, timing, noise = sensor.lens, sensor.timing, sensor.noise.feature_noise
    height, width = view.depth_mm.shape
    errors = depth_errors(uv, width, height, lens.depth_model)
    if inverse_depth_guess is None:
        near = _rough_inverse_depth(view.depth_mm, uv, errors, lens.depth_model)
    else:
        near = np.ascontiguousarray(inverse_depth_guess)
    delay_s = view.depth_delay_s + timing.depth_lag_s + timing.since_middle_s
    times_s = delay_s, timing.readout_s, timing.depth_readout_s
    flow, places = flow_and_places(lens.rays, lens.intrinsics, uv, near, twist, times_s, lens.depth_model)
    planes = read_planes(view.depth_mm, places, PLANE_LIMITS)
    return Measurements(
        *carried(
            flow,
            planes,
            errors,
            lens.intrinsics,
            uv,
            covariance_uv,
            noise.pixel_sigma**2,
            noise.inverse_depth_sigma,
            height,
            times_s,
        )
    )


def measure_exactly(view: View, sensor: SensorModel, uv: Array, twist: Array) -> Measurements:
    """Measure places at `uv` (n x 2 px) that have no error of their own, such as corners that define their patches."""
    return measure(view, sensor, uv, np.zeros((len(uv), 3)), twist)


def _rough_inverse_depth(depth_mm: NDArray[np.uint16], uv: Array, errors: Array, model: Array) -> Array:
    """Return the rough inverse depth (n, 1/m) of features by the depth image; that of 2 m where it shows none.

    In a depth image of a camera beside the colour one, a feature's pixel depends on the depth that is read there.
    """
    near = np.full(len(uv), _UNKNOWN_INVERSE_DEPTH)
    height, width = depth_mm.shape
    for _ in range(_LOOKS if model[2:4].any() else 1):
        places = uv - aside_px(model, uv, near, width, height)
        seen = (read_planes(depth_mm, places, PLANE_LIMITS)[:, 0] - errors[:, 0]) / errors[:, 1]
        near = np.where(seen > 0.0, seen, _UNKNOWN_INVERSE_DEPTH)
    return near
