"""Intrinsics in files beside the images: matrices of 3 x 3 or 4 x 4 numbers, and Open3D's JSON."""

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np

from odom.errors import ConfigError
from odom.frame import Camera

log = logging.getLogger(__name__)

_MIDDLE = 0.3, 0.7
"""Shares of an image's width and height between which its centre is; a Kinect's are within .03 of the middle. Images
cut to two thirds from one side still have theirs there. Chosen by hand."""
_UNREADABLE = (OSError, ValueError, KeyError, TypeError, IndexError)
"""What reading a file of numbers raises where it holds something else; ConfigError of a camera is none of these."""


def matrix_camera(file: Path, size: tuple[int, int]) -> Camera:
    """Return the camera of images of this size (width, height) by the matrix in a text file; raises ConfigError."""
    try:
        camera = _camera(np.loadtxt(file), size)
    except _UNREADABLE as error:
        raise ConfigError(f"{file}: give a matrix of 3 x 3 or 4 x 4 numbers: {error}") from error
    tell_other_size(file, camera)
    return camera


def tell_other_size(file: Path, camera: Camera) -> None:
    """Log that intrinsics from a file that holds no size of images are hardly for those that are there.

    Of images that were made smaller later, they lie beyond the middle.
    """
    if all(_MIDDLE[0] < c / side < _MIDDLE[1] for c, side in ((camera.cx, camera.width), (camera.cy, camera.height))):
        return
    log.warning(
        "%s: its centre %.1f, %.1f is far from the middle of images of %d x %d: it seems to be for images of some "
        "%.0f x %.0f; scale fx, fy, cx and cy as the images were scaled",
        file, camera.cx, camera.cy, camera.width, camera.height, 2 * camera.cx, 2 * camera.cy,
    )  # fmt: skip


def open3d_camera(file: Path) -> Camera:
    """Return the camera of Open3D's JSON: `width`, `height` and `intrinsic_matrix`; raises ConfigError.

    Open3D writes the matrix column by column; one that others wrote row by row is known by its last row, 0 0 1.
    """
    try:
        found = json.loads(file.read_text())
        K = np.array(found["intrinsic_matrix"], dtype=float).reshape(3, 3)
        return _camera(K if _ends_as_intrinsics(K) else K.T, (int(found["width"]), int(found["height"])))
    except _UNREADABLE as error:
        raise ConfigError(f"{file}: give Open3D's width, height and intrinsic_matrix: {error!r}") from error


def _camera(K: Any, size: tuple[int, int]) -> Camera:
    if not _ends_as_intrinsics(K):
        raise ValueError("the third row is not 0 0 1")
    return Camera(*size, float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]))


def _ends_as_intrinsics(K: Any) -> bool:
    return bool(np.allclose(K[2, :3], (0.0, 0.0, 1.0)))
