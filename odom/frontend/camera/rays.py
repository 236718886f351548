"""The rays of two cameras at the same pixels, compared after the rotation that aligns them best."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera
from odom.geometry.arrays import Array
from odom.geometry.rotations import turn_onto

_STEP_PX = 40
"""Distance of the pixels whose rays are used to turn one camera onto another."""
_UNTIL = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 40, 1e-9)
"""Steps and error (px) that end the search for the ray of a pixel: OpenCV's own 5 steps are wrong by up to a pixel in
the corners of a wide lens."""


def undistorted(camera: Camera, uv: NDArray[Any], R_rays_own: Array | None = None) -> Array:
    """Return x/z and y/z (n x 2) of the rays that a camera sees at the pixels `uv` (n x 2).

    `R_rays_own` (3 x 3) turns them from the camera's own frame into another; None leaves them there.
    """
    lens, pixels = np.array(camera.distortion or (0.0,) * 5), np.asarray(uv, dtype=np.float64).reshape(-1, 1, 2)
    if not len(pixels):
        return np.zeros((0, 2))
    rays = cv2.undistortPoints(pixels, camera.matrix, lens, None, R_rays_own, None, _UNTIL)
    return np.asarray(rays, dtype=np.float64).reshape(-1, 2)


def rays_of(camera: Camera, uv: Array) -> Array:
    """Return the unit vectors (n x 3, camera frame) along which a camera sees the pixels `uv` (n x 2)."""
    xy = undistorted(camera, uv)
    rays = np.column_stack([xy, np.ones(len(xy))])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


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
