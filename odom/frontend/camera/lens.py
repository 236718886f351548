"""The colour camera's lens: pixels to rays and camera coordinates to pixels, distortion included.

A better lens found during a run has its axis elsewhere in the image. That alone would turn the camera's frame by a
degree or two, and every pose with it. So its rays can be given in the frame of the camera first given.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from odom.errors import ConfigError
from odom.frame import Camera
from odom.frame.depth_model import field_terms
from odom.frontend.camera.rays import grid_over, rays_of, turn_between, undistorted
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

_NEAREST_M, _WIDEST = 0.1, 1.5
"""Points nearer (m), or with a larger tangent (56 degrees) off the axis to a side, are in no image."""
_CORNER = 1.5 * _WIDEST
"""No point considered has a larger tangent, in the lens's own axes."""

_K1, _K2, _P1, _P2, _K3, _K4, _K5, _K6 = range(8)
_R_XX, _R_XY, _R_XZ, _R_YX, _R_YY, _R_YZ, _R_ZX, _R_ZY, _R_ZZ = range(8, 17)
_ROTATION, _REACH = slice(8, 17), 17
"""Where `Lens.projection` has the coefficients, the rotation by rows, and how far the model holds."""


@dataclass(frozen=True, eq=False)
class Lens:
    """The lens of one camera: a table of rays, and the coefficients of its model.

    `rays` is H x W x 2: the normalised coordinates (x/z, y/z) seen by each pixel. `intrinsics` is (fx, fy, cx, cy), and
    `projection` (18) is what else it takes from a ray to its pixel: the 8 coefficients of distortion (k1, k2, p1, p2,
    k3, k4, k5, k6), zeros where unused, the rotation (by rows) from the frame of the rays to the camera's own axes, and
    the squared tangent of the angle from the axis up to which the model holds. `depth_model` (18) is the vector of the
    `DepthModel` of the depth image that is registered to it.
    """

    rays: NDArray[np.float32]
    intrinsics: Array
    projection: Array
    depth_model: Array

    @classmethod
    @lru_cache(maxsize=1)
    def of(cls, camera: Camera, frame_of: Camera | None = None) -> "Lens":
        """Return the lens of `camera`; the inverse distortion is solved once for every pixel (OpenCV).

        That takes some 40 ms at 640 x 480, so the newest lens is kept. Rays and inverse depths are in the frame of the
        camera `frame_of` (None: its own), by the rotation that fits the rays of both best. Raises ConfigError for
        coefficients beyond the rational model's eight (thin prism, tilt) that are not 0.
        """
        if any(camera.distortion[8:]):
            raise ConfigError(f"distortion {camera.distortion}: only the first 8 coefficients may differ from 0")
        turn = None if frame_of is None else turn_between(camera, frame_of)
        R_rays_own = np.eye(3) if turn is None else turn
        grid = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1)
        rays = undistorted(camera, grid, turn)
        projection = np.zeros(18)
        projection[: min(8, len(camera.distortion))] = camera.distortion[:8]
        projection[_ROTATION] = R_rays_own.T.ravel()
        projection[_REACH] = _reach(projection)
        return cls(
            rays.reshape(camera.height, camera.width, 2).astype(np.float32),
            np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
            projection,
            camera.depth.vector if frame_of is None else _turned_depth(camera, R_rays_own),
        )

    def project(self, points: Array, T_camera_points: Array, margin_px: float = 0.0) -> Array:
        """Return (n x 3): pixel u, v and depth z of `points` (n x 3, m), NaN where not in the image less a margin."""
        height, width = self.rays.shape[:2]
        return _project(points, T_camera_points, self.intrinsics, self.projection, width, height, margin_px)

    @property
    def R_own_rays(self) -> Array:
        """The rotation (3 x 3) from the frame of the rays to the camera's own."""
        return self.projection[_ROTATION].reshape(3, 3)


def _reach(k: Array) -> float:
    """Return the squared tangent up to which the image radius grows with the angle from the axis; may be infinite.

    Beyond it a polynomial turns back, and points far outside of the image would be projected into it.
    """
    r = np.linspace(0.0, _CORNER, 2000)
    r2 = r * r
    radial = (1 + r2 * (k[_K1] + r2 * (k[_K2] + r2 * k[_K3]))) / (1 + r2 * (k[_K4] + r2 * (k[_K5] + r2 * k[_K6])))
    turns = np.flatnonzero(np.diff(r * radial) <= 0.0)
    return float(r2[turns[0]]) if len(turns) else np.inf


def _turned_depth(camera: Camera, R_rays_own: Array) -> Array:
    """Return the vector (18) of a depth model by which inverse depths are along the turned axis.

    The distance along it is the one along the camera's own axis times a linear function of the ray.
    """
    model, uv = camera.depth.vector, grid_over(camera)
    rays = rays_of(camera, uv)
    terms = field_terms(uv, camera.width, camera.height)
    farther = rays @ R_rays_own[2] / rays[:, 2]
    model[10:16] = np.linalg.lstsq(terms, (terms @ model[10:16]) * farther, rcond=None)[0]
    return model


@compiled
def ray_at(rays: NDArray[np.float32], u: float, v: float) -> tuple[float, float]:
    """Return (x/z, y/z) seen at the sub-pixel position (u, v), bilinear between pixels and clamped to the image."""
    height, width = rays.shape[0], rays.shape[1]
    j = min(max(int(u), 0), width - 2)
    i = min(max(int(v), 0), height - 2)
    a, b = u - j, v - i
    x = (1 - b) * ((1 - a) * rays[i, j, 0] + a * rays[i, j + 1, 0]) + b * (
        (1 - a) * rays[i + 1, j, 0] + a * rays[i + 1, j + 1, 0]
    )
    y = (1 - b) * ((1 - a) * rays[i, j, 1] + a * rays[i, j + 1, 1]) + b * (
        (1 - a) * rays[i + 1, j, 1] + a * rays[i + 1, j + 1, 1]
    )
    return x, y


@compiled
def in_numbers(intrinsics: Array, k: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return both as tuples for `pixel_of`: a loop that calls it with those can take several pixels at a time."""
    first = (k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7], k[8])
    others = (k[9], k[10], k[11], k[12], k[13], k[14], k[15], k[16], k[17])
    return (intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]), first + others


@compiled
def pixel_of(
    x: float, y: float, intrinsics: Array | tuple[float, ...], k: Array | tuple[float, ...]
) -> tuple[float, float]:
    """Return the pixel (u, v) of the normalised coordinates (x/z, y/z): OpenCV's rational model, in the lens's axes.

    NaN where the model does not hold.
    """
    z = k[_R_ZX] * x + k[_R_ZY] * y + k[_R_ZZ]
    x, y = (k[_R_XX] * x + k[_R_XY] * y + k[_R_XZ]) / z, (k[_R_YX] * x + k[_R_YY] * y + k[_R_YZ]) / z
    r2 = x * x + y * y
    if r2 > k[_REACH]:
        return np.nan, np.nan
    radial = (1 + r2 * (k[_K1] + r2 * (k[_K2] + r2 * k[_K3]))) / (1 + r2 * (k[_K4] + r2 * (k[_K5] + r2 * k[_K6])))
    xd = x * radial + 2 * k[_P1] * x * y + k[_P2] * (r2 + 2 * x * x)
    yd = y * radial + k[_P1] * (r2 + 2 * y * y) + 2 * k[_P2] * x * y
    return intrinsics[0] * xd + intrinsics[2], intrinsics[1] * yd + intrinsics[3]


@compiled
def rays_at(rays: NDArray[np.float32], uv: Array) -> Array:
    """Return the normalised coordinates (n x 2) seen at the sub-pixel positions `uv` (n x 2)."""
    out = np.empty((uv.shape[0], 2))
    for k in range(uv.shape[0]):
        x, y = ray_at(rays, uv[k, 0], uv[k, 1])
        out[k, 0] = x
        out[k, 1] = y
    return out


@compiled
def ahead(T: Array, points: Array, k: int) -> tuple[float, float, float]:
    """Return (x/z, y/z, z) of `points[k]` before a camera at the pose `T`; z is 0 for one that is in no image."""
    X = T[0, 0] * points[k, 0] + T[0, 1] * points[k, 1] + T[0, 2] * points[k, 2] + T[0, 3]
    Y = T[1, 0] * points[k, 0] + T[1, 1] * points[k, 1] + T[1, 2] * points[k, 2] + T[1, 3]
    Z = T[2, 0] * points[k, 0] + T[2, 1] * points[k, 1] + T[2, 2] * points[k, 2] + T[2, 3]
    if Z < _NEAREST_M or abs(X) > _WIDEST * Z or abs(Y) > _WIDEST * Z:
        return 0.0, 0.0, 0.0
    return X / Z, Y / Z, Z


@compiled
def _project(
    points: Array, T_camera_points: Array, intrinsics: Array, projection: Array, width: int, height: int, margin: float
) -> Array:
    """Return pixels and depths as `Lens.project` does."""
    out = np.full((points.shape[0], 3), np.nan)
    for k in range(points.shape[0]):
        x, y, z = ahead(T_camera_points, points, k)
        if z == 0.0:
            continue
        u, v = pixel_of(x, y, intrinsics, projection)
        if margin <= u <= width - 1 - margin and margin <= v <= height - 1 - margin:
            out[k, 0], out[k, 1], out[k, 2] = u, v, z
    return out
