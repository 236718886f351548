"""The rays of two cameras at the same pixels, compared after the rotation that aligns them best."""

import cv2
import numpy as np

from odom.frame import Camera
from odom.geometry.arrays import Array

_STEP_PX = 40
"""Distance of the pixels whose rays are used to turn one camera onto another."""


def rays_of(camera: Camera, uv: Array) -> Array:
    """Return the unit vectors (n x 3, camera frame) along which a camera sees the pixels `uv` (n x 2)."""
    lens = np.array(camera.distortion or (0.0,) * 5)
    xy = cv2.undistortPoints(uv.reshape(-1, 1, 2), camera.matrix, lens).reshape(-1, 2)
    rays = np.column_stack([xy, np.ones(len(xy))])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def turn_onto(rays: Array, onto: Array) -> Array:
    """Return the rotation (3 x 3) that brings `rays` (n x 3) onto `onto` (n x 3) by least squares.

    Source: W. Kabsch, 1976.
    """
    U, _, Vt = np.linalg.svd(rays.T @ onto)
    return np.asarray(Vt.T @ np.diag([1.0, 1.0, np.linalg.det(Vt.T @ U.T)]) @ U.T)


def turned_onto(rays: Array, onto: Array) -> Array:
    """Return `rays` (n x 3) after that rotation: a camera turned in its housing gives equal trajectories."""
    return np.asarray(rays @ turn_onto(rays, onto).T)


def grid_over(camera: Camera) -> Array:
    """Return pixels (n x 2) spread evenly over a camera's image, its corners among them."""
    columns, rows = (np.linspace(0.0, side - 1.0, 1 + side // _STEP_PX) for side in (camera.width, camera.height))
    return np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)


def turn_between(camera: Camera, onto: Camera) -> Array:
    """Return the rotation (3 x 3) from a camera's own axes to those of `onto` that brings the rays of both nearest."""
    uv = grid_over(camera)
    return turn_onto(rays_of(camera, uv), rays_of(onto, uv))
