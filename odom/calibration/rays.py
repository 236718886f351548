"""The directions in which two cameras see the same pixels, compared after the rotation that brings them nearest."""

import cv2
import numpy as np

from odom.frame import Camera
from odom.geometry.arrays import Array


def rays_of(camera: Camera, uv: Array) -> Array:
    """Return the unit vectors (n x 3, camera frame) along which a camera sees the pixels `uv` (n x 2)."""
    lens = np.array(camera.distortion or (0.0,) * 5)
    xy = cv2.undistortPoints(uv.reshape(-1, 1, 2), camera.matrix, lens).reshape(-1, 2)
    rays = np.column_stack([xy, np.ones(len(xy))])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def turned_onto(rays: Array, onto: Array) -> Array:
    """Return `rays` (n x 3) after the rotation that brings them nearest to `onto` (n x 3), in the sense of squares.

    A camera that is turned in its housing makes the same walks. Source: W. Kabsch, 1976.
    """
    U, _, Vt = np.linalg.svd(rays.T @ onto)
    R = Vt.T @ np.diag([1.0, 1.0, np.linalg.det(Vt.T @ U.T)]) @ U.T
    return np.asarray(rays @ R.T)
