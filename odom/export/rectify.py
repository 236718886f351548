"""Images as a pinhole camera with a global shutter would have taken them."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera
from odom.frontend.camera.rays import undistorted
from odom.geometry.arrays import Array, Image

_UNKNOWN_DEPTH_M = 2.0
"""Of pixels without depth: rotation, which moves most, does not depend on it."""
_ROUNDS = 3
"""To find the row that a pixel was taken in; each leaves a few percent of the error of the one before."""


def pinhole_of(camera: Camera) -> Camera:
    """Return the camera without distortion whose image lies within that of `camera`; itself without distortion."""
    if not any(camera.distortion):
        return replace(camera, distortion=())
    size = (camera.width, camera.height)
    K, _ = cv2.getOptimalNewCameraMatrix(camera.matrix, np.array(camera.distortion), size, 0.0)
    return Camera(*size, float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]))


class Rectifier:
    """Takes images of `camera` to those of `pinhole`; with a `readout_s` and a motion it undoes the rolling shutter."""

    def __init__(self, camera: Camera, readout_s: float = 0.0) -> None:
        self.pinhole = pinhole_of(camera)
        self._camera, self._readout_s = camera, readout_s
        u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
        out = self.pinhole
        self._rays = np.stack([(u - out.cx) / out.fx, (v - out.cy) / out.fy, np.ones(u.shape)], axis=-1)
        self._still = self._pixels(self._rays)

    def sources(self, depth_mm: NDArray[np.uint16], twist: Array) -> NDArray[np.float32]:
        """Return for each pixel of the pinhole image where it is in the image as taken (H x W x 2 px).

        `depth_mm` (H x W) is the depth image as taken, `twist` (6: m/s, rad/s, camera frame) the camera's velocity.
        """
        if not self._readout_s or not twist.any():
            return self._still
        z = self.depth(depth_mm, self._still).astype(np.float64)[..., None] * 1e-3
        z[z == 0] = _UNKNOWN_DEPTH_M
        points = self._rays * z
        flow = twist[:3] + np.cross(twist[3:], points)
        pixels = self._still
        for _ in range(_ROUNDS):
            since_middle_s = self._readout_s * (pixels[..., 1:].astype(np.float64) / self._camera.height - 0.5)
            pixels = self._pixels(points - since_middle_s * flow)
        return pixels

    def color(self, color: Image, sources: NDArray[np.float32]) -> Image:
        """Return the colour image at those pixels, bilinear."""
        return np.asarray(cv2.remap(color, *_maps(sources), cv2.INTER_LINEAR))

    def depth(self, depth_mm: NDArray[np.uint16], sources: NDArray[np.float32]) -> NDArray[np.uint16]:
        """Return the depth image at those pixels, each the nearest one's: depths are never mixed."""
        return np.asarray(cv2.remap(depth_mm, *_maps(sources), cv2.INTER_NEAREST), dtype=np.uint16)

    def points(self, uv: Array, depth_m: Array, twist: Array) -> Array:
        """Return where pixels `uv` (n x 2) of the image as taken, with depths (n, m), are in the pinhole image."""
        if not len(uv):
            return np.zeros((0, 2))
        points = (
            np.column_stack([undistorted(self._camera, uv), np.ones(len(uv))])
            * np.where(depth_m > 0, depth_m, _UNKNOWN_DEPTH_M)[:, None]
        )
        since_middle_s = self._readout_s * (uv[:, 1:] / self._camera.height - 0.5)
        points = points + since_middle_s * (twist[:3] + np.cross(twist[3:], points))
        out = self.pinhole
        return np.asarray(points[:, :2] / points[:, 2:] * [out.fx, out.fy] + [out.cx, out.cy])

    def _pixels(self, points: Array) -> NDArray[np.float32]:
        """Return the pixels (H x W x 2) of points (H x W x 3, camera frame) in the image as taken."""
        coefficients = np.array(self._camera.distortion or (0.0,) * 5)
        flat = points.reshape(-1, 1, 3)
        pixels, _ = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), self._camera.matrix, coefficients)
        return pixels.reshape(*points.shape[:2], 2).astype(np.float32)


def _maps(sources: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    return np.ascontiguousarray(sources[..., 0]), np.ascontiguousarray(sources[..., 1])
