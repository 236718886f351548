"""Intrinsics in files beside the images: matrices, fx fy cx cy in a row, Open3D's JSON and BundleFusion's info.txt."""

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np

from odom.errors import ConfigError
from odom.frame import Camera
from sensors.calibration_per_image import camera_of_all_images
from sensors.image_names import visible

log = logging.getLogger(__name__)

_MIDDLE = 0.3, 0.7
"""Shares of an image's width and height between which its centre is; a Kinect's are within .03 of the middle. Images
cut to two thirds from one side still have theirs there. Chosen by hand."""
_UNREADABLE = (OSError, ValueError, KeyError, TypeError, IndexError, ConfigError)
"""What reading a file of numbers raises where it holds something else, or what no camera has."""


def camera_beside(path: Path, size: tuple[int, int]) -> Camera | None:
    """Return the camera of a folder's images of this size (width, height) by the first file there that describes one.

    These are Open3D's `*intrinsic*.json`, `*intrinsic*.txt` with a matrix, `calibration.txt` with fx fy cx cy, and
    rtabmap's `calib/*.yaml`, one an image.
    Raises ConfigError where one of the first two holds something else.
    """
    if files := sorted(visible(path, "*intrinsic*.json")):
        return open3d_camera(files[0])
    if files := sorted(visible(path, "*intrinsic*.txt")):
        return matrix_camera(files[0], size)
    if (path / "calibration.txt").is_file():
        return row_camera(path / "calibration.txt", size)
    return camera_of_all_images(path)


def row_camera(file: Path, size: tuple[int, int]) -> Camera | None:
    """Return the camera of a file that holds fx fy cx cy; anything else is told and left aside."""
    try:
        fx, fy, cx, cy = map(float, _text(file).split())
        camera = Camera(*size, fx, fy, cx, cy)
    except (OSError, ValueError, ConfigError) as error:
        log.warning("%s is left aside, it is not fx fy cx cy: %s", file, error)
        return None
    tell_other_size(file, camera)
    return camera


def matrix_camera(file: Path, size: tuple[int, int]) -> Camera:
    """Return the camera of images of this size (width, height) by the matrix in a text file; raises ConfigError."""
    try:
        rows = [words for line in _text(file).splitlines() if (words := line.partition("#")[0].split())]
        if not rows:
            raise ValueError("it holds none")
        camera = _camera(np.array(rows, dtype=float), size)
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
        found = json.loads(_text(file))
        K = np.array(found["intrinsic_matrix"], dtype=float).reshape(3, 3)
        return _camera(K if _ends_as_intrinsics(K) else K.T, (int(found["width"]), int(found["height"])))
    except _UNREADABLE as error:
        raise ConfigError(f"{file}: give Open3D's width, height and intrinsic_matrix: {error!r}") from error


def sens_cameras(file: Path) -> tuple[Camera | None, Camera | None, float]:
    """Return what BundleFusion's `info.txt` holds: colour's camera, depth's where it is another, depth's units a metre.

    Without such a file they are None, None and 1000. Raises ConfigError where a line is missing or malformed.
    """
    if not file.is_file():
        return None, None, 1000.0
    try:
        lines = (line.partition("=") for line in _text(file).splitlines())
        found = {name.strip().removeprefix("m_").lower(): value.split() for name, _, value in lines}
        color, depth = (_sens_camera(found, which) for which in ("color", "depth"))
        scale = float(found["depthshift"][0])
        if not 1 <= scale <= 1e6:
            raise ValueError(f"m_depthShift {scale:g} units a metre")
    except _UNREADABLE as error:
        raise ConfigError(
            f"{file}: give m_colorWidth, m_colorHeight and m_calibrationColorIntrinsic, the same of depth, and "
            f"m_depthShift, a line each: {error!r}"
        ) from error
    return color, None if depth == color else depth, scale


def _text(file: Path) -> str:
    """Return the text of a file, without the mark of the bytes' order that some editors begin it with."""
    return file.read_text(encoding="utf-8-sig")


def _sens_camera(found: dict[str, list[str]], which: str) -> Camera:
    K = np.array(found[f"calibration{which}intrinsic"], dtype=float).reshape(4, 4)
    return _camera(K, (int(found[f"{which}width"][0]), int(found[f"{which}height"][0])))


def _camera(K: Any, size: tuple[int, int]) -> Camera:
    if not _ends_as_intrinsics(K):
        raise ValueError("the third row is not 0 0 1")
    return Camera(*size, float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]))


def _ends_as_intrinsics(K: Any) -> bool:
    return bool(np.allclose(K[2, :3], (0.0, 0.0, 1.0)))
