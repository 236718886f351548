"""Intrinsics in files beside the images: matrices of 3 x 3 or 4 x 4 numbers, and Open3D's JSON."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from odom.errors import ConfigError
from odom.frame import Camera

_UNREADABLE = (OSError, ValueError, KeyError, TypeError, IndexError)
"""What reading a file of numbers raises where it holds something else; ConfigError of a camera is none of these."""


def matrix_camera(file: Path, size: tuple[int, int]) -> Camera:
    """Return the camera of images of this size (width, height) by the matrix in a text file; raises ConfigError."""
    try:
        return _camera(np.loadtxt(file), size)
    except _UNREADABLE as error:
        raise ConfigError(f"{file}: give a matrix of 3 x 3 or 4 x 4 numbers: {error}") from error


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
