"""Calibrations in OpenCV's own YAML (`%YAML:1.0`, `!!opencv-matrix`): of its calibration program and of ORB-SLAM.

Their contents are returned under ROS's keys, which `calibration_file` reads.
"""

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from odom.errors import ConfigError

_HEADER = "%YAML:1.0"
_MATRIX_TAG = "!!opencv-matrix"
_ORB_SLAM = re.compile(r"^Camera1?\.fx\s*:", re.MULTILINE)
"""What OpenCV's YAML begins with, and what tells it where that line is missing."""
_MATRICES = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K")
_LENSES = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "D")
_WIDTHS = ("image_width", "image_Width", "Camera.width", "width")
_HEIGHTS = ("image_height", "image_Height", "Camera.height", "height")
_SCALES = ("depth_scale", "DepthMapFactor", "RGBD.DepthMapFactor")
"""Names under which OpenCV's programs, old and new, and ORB-SLAM keep matrix, lens, size and units of depth a metre."""
_PREFIXES = ("Camera.", "Camera1.", "")
"""What stands before fx, fy, cx and cy: in ORB-SLAM2, in ORB-SLAM3, and in files of one's own."""
_INTRINSICS, _COEFFICIENTS = ("fx", "fy", "cx", "cy"), ("k1", "k2", "p1", "p2", "k3")
_PINHOLE = ("", "PinHole", "Pinhole", "Rectified")
"""ORB-SLAM's names of cameras whose lens has these coefficients."""
_PLUMB_BOB = 5
"""Coefficients that ROS's `plumb_bob` has; with more the lens is `rational_polynomial`."""
_METRES = 1.0
"""ORB-SLAM's units a metre where its depth comes as floats in metres: nothing is said of 16-bit images."""


def is_opencv_yaml(text: str) -> bool:
    """Whether the text of a file is in OpenCV's YAML, which ordinary parsers refuse."""
    return text.startswith(_HEADER) or _MATRIX_TAG in text or _ORB_SLAM.search(text) is not None


def opencv_content(path: Path, text: str) -> dict[str, Any]:
    """Return the camera that OpenCV's YAML holds, and `depth_scale` if it says one, under ROS's keys.

    Raises ConfigError when it cannot be parsed, or naming what is missing.
    """
    storage = opencv_storage(path, text)
    try:
        return _content(storage, path)
    finally:
        storage.release()


def opencv_storage(path: Path, text: str) -> cv2.FileStorage:
    """Return OpenCV's YAML as it parses it, whichever form its header has; raises ConfigError."""
    body = text.partition("\n")[2] if text.startswith("%YAML") else text
    try:
        storage = cv2.FileStorage(f"{_HEADER}\n{body}", cv2.FileStorage_READ | cv2.FileStorage_MEMORY)
    except (cv2.error, SystemError) as error:
        raise ConfigError(
            f"calibration {path} cannot be read as OpenCV's YAML: {' '.join(str(error).split())}"
        ) from error
    if storage.root().isSeq():
        raise ConfigError(f"calibration {path} is a list: give names with their values")
    return storage


def _content(storage: cv2.FileStorage, path: Path) -> dict[str, Any]:
    model = storage.getNode("Camera.type").string()
    if model not in _PINHOLE:
        raise ConfigError(f"calibration {path}: Camera.type {model} is not supported: calibrate as PinHole")
    width, height = _number(storage, _WIDTHS), _number(storage, _HEIGHTS)
    matrix, lens = _pinhole(storage, path)
    wanted = {
        "a camera_matrix of 3 x 3 numbers, or fx, fy, cx and cy (Camera.fx ... in ORB-SLAM)": matrix,
        "the images' width (image_width or Camera.width)": width,
        "their height (image_height or Camera.height)": height,
    }
    if missing := [what for what, value in wanted.items() if value is None]:
        raise ConfigError(f"calibration {path} lacks {'; '.join(missing)}")
    scale = _number(storage, _SCALES)
    return {
        "image_width": width,
        "image_height": height,
        "camera_matrix": {"data": matrix},
        "distortion_model": storage.getNode("distortion_model").string()
        or ("plumb_bob" if len(lens) <= _PLUMB_BOB else "rational_polynomial"),
        "distortion_coefficients": {"data": lens},
        **({} if scale in (None, _METRES) else {"depth_scale": scale}),
    }


def _pinhole(storage: cv2.FileStorage, path: Path) -> tuple[list[float] | None, list[float]]:
    """Return the nine numbers of the camera's matrix, None without one, and the lens's coefficients."""
    for prefix in _PREFIXES:
        intrinsics = [_number(storage, (prefix + name,)) for name in _INTRINSICS]
        fx, fy, cx, cy = intrinsics
        if fx is not None and fy is not None and cx is not None and cy is not None:
            lens = [_number(storage, (prefix + name,)) or 0.0 for name in _COEFFICIENTS]
            return [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], lens
    K, D = matrix_at(storage, path, _MATRICES), matrix_at(storage, path, _LENSES)
    return (None if K is None or K.shape != (3, 3) else K.ravel().tolist()), ([] if D is None else D.ravel().tolist())


def matrix_at(
    node: cv2.FileStorage | cv2.FileNode, path: Path, names: tuple[str, ...]
) -> np.ndarray[Any, np.dtype[Any]] | None:
    """Return the first matrix of these names below a node, None without one.

    It need not be tagged as OpenCV's, as ROS's keys in such a file are not. Raises ConfigError where it is none.
    """
    found = next(((name, at) for name in names if (at := node.getNode(name)).isMap()), None)
    if found is None:
        return None
    name, at = found
    rows, cols = (int(_number(at, (side,)) or 0) for side in ("rows", "cols"))
    data = at.getNode("data")
    items = [data.at(k) for k in range(data.size())] if data.isSeq() else []
    numbers = [item.real() for item in items if item.isReal() or item.isInt()]
    if not data.isSeq() or rows < 0 or not len(numbers) == len(items) == rows * cols:
        raise ConfigError(f"calibration {path}: {name} is no matrix of as many numbers as its rows and cols say")
    return np.array(numbers).reshape(rows, cols)


def _number(storage: cv2.FileStorage | cv2.FileNode, names: tuple[str, ...]) -> float | None:
    found = (node for name in names if (node := storage.getNode(name)).isReal() or node.isInt())
    return next((node.real() for node in found), None)
