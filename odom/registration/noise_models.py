"""Depth noise models: from a pixel and its depth to the covariance of the point in the camera's frame.

Sources: the paper's Z-levels (eqs. 17, 19-21); K. Khoshelham and S. Elberink, Sensors 12, 2012 (Kinect v1); C. Nguyen,
S. Izadi and D. Lovell, 3DIMPVT 2012 (Kinect v1 with the angle of incidence); J. Smisek et al., "3D with Kinect", ICCV
Workshops 2011 (its depth steps); P. Fankhauser et al., ICAR 2015 (Kinect v2). A step has variance step^2 / 12.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.frame import UNKNOWN_DEPTH_MM, Camera
from odom.geometry.arrays import Array


class NoiseModel(Protocol):
    """Standard deviations of a measured pixel and its depth."""

    def sigmas(self, depth_m: Array, incidence_rad: Array | float = 0.0) -> tuple[Array, Array]:
        """Return sigma of the pixel (both image axes, px) and of the depth (m) for depths `depth_m` (n, m).

        `incidence_rad` is the angle between the viewing ray and the surface's normal, 0 where it is not known.
        """
        ...


def _steepness(incidence_rad: Array | float, power: int) -> Array | float:
    """Return `(th / (pi/2 - th))^power`, the growth of noise on slanted surfaces; constant from 80 degrees on."""
    th = np.minimum(np.abs(incidence_rad), np.deg2rad(80.0))
    return np.asarray((th / (np.pi / 2 - th)) ** power)


@dataclass(frozen=True)
class KinectV1:
    """Khoshelham and Elberink's random error `1.425e-3 z^2` m, and the quantisation step of the 11-bit disparity."""

    pixel_sigma: float = 0.5

    def sigmas(self, depth_m: Array, incidence_rad: Array | float = 0.0) -> tuple[Array, Array]:
        """Return pixel and depth sigmas (see NoiseModel); the angle of incidence is not part of this model."""
        variance = (1.425e-3 * depth_m**2) ** 2 + _kinect_v1_step(depth_m) ** 2 / 12.0
        return np.full(np.shape(depth_m), self.pixel_sigma), np.sqrt(variance)


@dataclass(frozen=True)
class KinectV1Incidence:
    """Nguyen, Izadi and Lovell's axial and lateral noise of a Kinect v1, with the angle of incidence."""

    pixel_sigma: float = 0.5

    def sigmas(self, depth_m: Array, incidence_rad: Array | float = 0.0) -> tuple[Array, Array]:
        """Return pixel and depth sigmas (see NoiseModel); the sensor's lateral noise adds to the feature's."""
        axial = 0.0012 + 0.0019 * (depth_m - 0.4) ** 2 + 0.0001 / np.sqrt(depth_m) * _steepness(incidence_rad, 2)
        lateral = 0.8 + 0.035 * _steepness(incidence_rad, 1)
        pixel = np.broadcast_to(np.hypot(lateral, self.pixel_sigma), depth_m.shape)
        return np.array(pixel), np.sqrt(axial**2 + _kinect_v1_step(depth_m) ** 2 / 12.0)


@dataclass(frozen=True)
class KinectV2:
    """Fankhauser's time-of-flight noise; lateral 1.6 mm seen through `focal_px` (365 for its depth camera)."""

    pixel_sigma: float = 0.5
    lateral_m: float = 0.0016
    focal_px: float = 365.0

    def sigmas(self, depth_m: Array, incidence_rad: Array | float = 0.0) -> tuple[Array, Array]:
        """Return pixel and depth sigmas (see NoiseModel)."""
        axial_mm = 1.5 - 0.5 * depth_m + 0.3 * depth_m**2 + 0.1 * depth_m**1.5 * _steepness(incidence_rad, 2)
        return np.hypot(self.pixel_sigma, self.lateral_m * self.focal_px / depth_m), 1e-3 * np.asarray(axial_mm)


@dataclass(frozen=True)
class Generic:
    """Any other depth camera: `floor_m + slope z^exponent` m, a pixel sigma, and the step of a stored depth value.

    The defaults are about a Kinect v1's (Khoshelham and Elberink) above a floor of 1 mm, stored in millimetres.
    """

    floor_m: float = 0.001
    slope: float = 0.0014
    exponent: float = 2.0
    pixel_sigma: float = 0.5
    step_m: float = 0.001

    def sigmas(self, depth_m: Array, incidence_rad: Array | float = 0.0) -> tuple[Array, Array]:
        """Return pixel and depth sigmas (see NoiseModel); the angle of incidence is not part of this model."""
        axial = self.floor_m + self.slope * depth_m**self.exponent
        return np.full(np.shape(depth_m), self.pixel_sigma), np.sqrt(axial**2 + self.step_m**2 / 12.0)


@dataclass(frozen=True, eq=False)
class ZLevels:
    """The paper's model: depth varies within the `i` levels to either side of the one measured (eq. 17).

    `levels_m` are the sensor's distinct depths, increasing. The paper's covariance (eq. 21) is of rank 1, along the
    viewing ray; the pixel's own sigma makes it a full one. Raises InputError when there are fewer than 2 i + 1
    levels, or they do not increase.
    """

    levels_m: Array
    i: int = 3
    pixel_sigma: float = 0.5

    def __post_init__(self) -> None:
        levels = np.ascontiguousarray(self.levels_m, dtype=np.float64)
        if self.i < 1 or levels.ndim != 1 or len(levels) < 2 * self.i + 1 or not (np.diff(levels) > 0).all():
            raise InputError(
                f"{levels.shape} depth levels with i = {self.i}: give at least 2 i + 1 increasing depths in metres"
            )
        object.__setattr__(self, "levels_m", levels)

    @classmethod
    def kinect_v1(cls, i: int = 3, pixel_sigma: float = 0.5) -> "ZLevels":
        """Return the levels of the Kinect v1's raw 11-bit disparity, `z = 1 / (-0.00307 d + 3.3309)` m (OpenKinect)."""
        disparity = np.arange(0.0, 1084.0)
        return cls(1.0 / (-0.00307 * disparity + 3.3309), i, pixel_sigma)

    @classmethod
    def from_depth(cls, depth_mm: NDArray[np.uint16], i: int = 3, pixel_sigma: float = 0.5) -> "ZLevels":
        """Return the levels that a sensor has shown in `depth_mm` (any shape, 0 and 65535 are no measurement)."""
        values = np.flatnonzero(np.bincount(depth_mm.ravel()))
        return cls(
            np.asarray(values[(values > 0) & (values < UNKNOWN_DEPTH_MM)] * 1e-3, dtype=np.float64), i, pixel_sigma
        )

    def sigmas(self, depth_m: Array, incidence_rad: Array | float = 0.0) -> tuple[Array, Array]:
        """Return pixel and depth sigmas (see NoiseModel); outside the table the end's spacing holds."""
        last = len(self.levels_m) - 1
        after = np.clip(np.searchsorted(self.levels_m, depth_m), 1, last)
        nearer = depth_m - self.levels_m[after - 1] < self.levels_m[after] - depth_m
        k = np.clip(after - nearer, self.i, last - self.i)
        sigma_z = 0.5 * (self.levels_m[k + self.i] - self.levels_m[k - self.i])  # eq. (17)
        return np.full(np.shape(depth_m), self.pixel_sigma), sigma_z


def _kinect_v1_step(depth_m: Array) -> Array:
    """Return the Kinect v1's depth step (m): `2.73 z^2 + .74 z - .58` mm (Smisek), at least the stored millimetre."""
    return 1e-3 * np.maximum(2.73 * depth_m**2 + 0.74 * depth_m - 0.58, 1.0)


def back_project(camera: Camera, uv: Array, depth_m: Array) -> Array:
    """Return the n x 3 points (m) of undistorted pixels `uv` (n x 2) at depths `depth_m` (n): eq. (19).

    Lists are taken as well. Raises InputError when shapes disagree.
    """
    uv, depth_m = _of_one_length(uv, depth_m)
    out = np.empty((len(depth_m), 3))
    out[:, 0] = depth_m / camera.fx * (uv[:, 0] - camera.cx)
    out[:, 1] = depth_m / camera.fy * (uv[:, 1] - camera.cy)
    out[:, 2] = depth_m
    return out


def _of_one_length(uv: Array, depth_m: Array) -> tuple[Array, Array]:
    uv, depth_m = np.asarray(uv, dtype=np.float64), np.asarray(depth_m, dtype=np.float64)
    if depth_m.ndim != 1 or uv.shape != (len(depth_m), 2):
        raise InputError(f"pixels of shape {uv.shape} with depths of shape {depth_m.shape}: give n x 2 and n")
    return uv, depth_m


def point_covariances(
    model: NoiseModel, camera: Camera, uv: Array, depth_m: Array, incidence_rad: Array | float = 0.0
) -> Array:
    """Return the n x 3 x 3 covariances (m^2, camera frame) of the points behind pixels `uv` at depths `depth_m`.

    `uv` (n x 2) are undistorted pixels, `depth_m` (n) positive metres. The depth's part is eqs. (20)-(21), along the
    viewing ray; the pixel's is across: `J diag(su^2, sv^2, sz^2) J'` with J the Jacobian of eq. (19).
    Raises InputError for depths that are not positive and finite, shapes that disagree, or a class given as model.
    """
    if isinstance(model, type):
        raise InputError(f"the class {model.__name__} given as noise model: give a model of it, {model.__name__}()")
    uv, z = _of_one_length(uv, depth_m)
    if not (z > 0.0).all() or not np.isfinite(z).all() or not np.isfinite(uv).all():
        raise InputError("depths must be positive and finite: leave out pixels without a measurement")
    sigma_px, sigma_z = model.sigmas(z, incidence_rad)
    a = (uv[:, 0] - camera.cx) / camera.fx  # sigma_x / sigma_z, eq. (20)
    b = (uv[:, 1] - camera.cy) / camera.fy  # sigma_y / sigma_z, eq. (20)
    vz = sigma_z**2
    lateral = (sigma_px * z) ** 2
    C = np.empty((len(z), 3, 3))
    C[:, 0, 0] = lateral / camera.fx**2 + a * a * vz  # eq. (21) and the pixel term
    C[:, 1, 1] = lateral / camera.fy**2 + b * b * vz
    C[:, 2, 2] = vz
    C[:, 0, 1] = C[:, 1, 0] = a * b * vz
    C[:, 0, 2] = C[:, 2, 0] = a * vz
    C[:, 1, 2] = C[:, 2, 1] = b * vz
    return C
