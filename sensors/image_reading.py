"""Image files of a folder in any format that OpenCV reads by itself; only JPEG and PNG go over the wire as they are."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.wire.codec.image_files import MAX_PIXELS, OtherFormatError, decode_file

_OTHER_FORMATS = (b"BM", b"II*\0", b"MM\0*", b"P5", b"P6", b"RIFF")
"""What files begin with that OpenCV reads as well, and refuses where they are cut: BMP, TIFF (both byte orders), PGM,
PPM and WebP."""


def read_image(data: NDArray[np.uint8], flags: int) -> NDArray[Any]:
    """Return the image of a file's bytes as OpenCV's `flags` ask for it, EXIF orientation ignored.

    Raises OtherFormatError for a format that is not read, WireError for a file that is cut, malformed or too large.
    """
    try:
        return decode_file(data, flags)
    except OtherFormatError as error:
        if not data[:4].tobytes().startswith(_OTHER_FORMATS):
            raise OtherFormatError("none of JPEG, PNG, TIFF, BMP, PGM, PPM and WebP") from error
    try:
        image = cv2.imdecode(data, flags | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise WireError(f"image file cannot be decoded: {error}") from error
    if image is None or not 0 < image.shape[0] * image.shape[1] <= MAX_PIXELS:
        raise WireError(f"image file of {data.size} bytes is cut, damaged or too large")
    return np.asarray(image)


def image_in(file: Path, flags: int) -> NDArray[Any] | None:
    """Return the image in a file as OpenCV's `flags` ask for it, None when it cannot be read."""
    try:
        return read_image(np.fromfile(file, dtype=np.uint8), flags)
    except (WireError, OSError):
        return None
