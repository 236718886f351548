"""Masks in image files: white where a camera sees what carries it, a robot's deck or a rig, instead of the scene."""

from pathlib import Path

import cv2
import numpy as np

from odom.backend.odometry.segmentation import Segmenter
from odom.errors import ConfigError
from odom.frame import Camera
from odom.geometry.arrays import Mask

_WHITE = 128
"""Grey level from which on a pixel is marked: masks are drawn by hand, too, with soft edges."""
_SAME_FORM = 0.01
"""Share by which the ratio of width to height may differ, for a mask of another size."""


def write_mask(path: Path, mask: Mask) -> None:
    """Write a mask (H x W) as an image, white where it marks.

    Raises ConfigError for a name without a known format, OSError when the file cannot be written.
    """
    try:
        _, file = cv2.imencode(path.suffix, np.where(mask, 255, 0).astype(np.uint8))
    except cv2.error:
        raise ConfigError(f"{path}: give the name of a .png file") from None
    path.write_bytes(file.tobytes())


def read_mask(path: Path) -> Mask:
    """Return what an image marks (H x W); raises ConfigError where there is none, or where it marks nothing."""
    try:
        image = cv2.imdecode(np.fromfile(path, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    except (OSError, cv2.error):  # OpenCV's of an empty file
        image = None
    if image is None:
        raise ConfigError(f"the mask {path} is no image that can be read: make one with odom mask")
    mask = np.asarray(image >= _WHITE)
    if not mask.any() or mask.all():
        colour = "black" if not mask.any() else "white"
        raise ConfigError(
            f"the mask {path} is all {colour}: it has to be white where the scene is not seen, else black"
        )
    return mask


def masked_by(path: Path | None, camera: Camera) -> Segmenter | None:
    """Return what marks the same part in every frame of a camera, as an image says; None without one.

    An image of another size is scaled. Raises ConfigError where it is of another form than the camera's images.
    """
    if path is None:
        return None
    mask, (width, height) = read_mask(path), (camera.width, camera.height)
    if abs(mask.shape[1] * height / (mask.shape[0] * width) - 1.0) > _SAME_FORM:
        given = f"{mask.shape[1]} x {mask.shape[0]}"
        raise ConfigError(f"the mask {path} is {given}, the camera's images are {width} x {height}")
    scaled = cv2.resize(mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    return lambda frame: scaled
