"""Image files of a folder that OpenCV reads by itself, and numpy's; only JPEG and PNG go over the wire as they are."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
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
_NUMPY = b"\x93NUMPY"


def read_image(data: NDArray[np.uint8], flags: int) -> NDArray[Any]:
    """Return the image of a file's bytes as OpenCV's `flags` ask for it, EXIF orientation ignored.

    numpy's files are read as they are, and where colour is not asked for: the order of its channels is not known.
    Raises OtherFormatError for a format that is not read, WireError for a file that is cut, malformed or too large.
    """
    try:
        return decode_file(data, flags)
    except OtherFormatError as error:
        if data[: len(_NUMPY)].tobytes() == _NUMPY and flags == cv2.IMREAD_UNCHANGED:
            return _numpy_array(data)
        if not data[:4].tobytes().startswith(_OTHER_FORMATS):
            raise OtherFormatError("none of JPEG, PNG, TIFF, BMP, PGM, PPM and WebP") from error
    try:
        with _opencv_silent():
            image = cv2.imdecode(data, flags | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise WireError(f"image file cannot be decoded: {error}") from error
    if image is None or not 0 < image.shape[0] * image.shape[1] <= MAX_PIXELS:
        raise WireError(f"image file of {data.size} bytes is cut, damaged or too large")
    return np.asarray(image)


def image_in(file: Path) -> NDArray[Any] | None:
    """Return the image in a file as it is, with its own channels and bits, None when it cannot be read."""
    try:
        return read_image(np.fromfile(file, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except (WireError, OSError):
        return None


def is_known_to_opencv(file: Path) -> bool:
    """Return whether a file begins as one that OpenCV reads.

    It does not say so of one whose name is no UTF-8: such a name ends the process there.
    """
    try:
        str(file).encode()
    except UnicodeEncodeError:
        return False
    return bool(cv2.haveImageReader(str(file)))


@contextmanager
def _opencv_silent() -> Iterator[None]:
    """Keep OpenCV from writing of a damaged file to the terminal, which who reads it tells in the log."""
    log = cv2.utils.logging
    before = log.getLogLevel()
    log.setLogLevel(log.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        log.setLogLevel(before)


def _numpy_array(data: NDArray[np.uint8]) -> NDArray[Any]:
    """Return the numbers in a `.npy` file, H x W (x 1); raises WireError."""
    file, headers = BytesIO(data.tobytes()), np.lib.format
    try:
        first = headers.read_magic(file) == (1, 0)
        shape, _, dtype = (headers.read_array_header_1_0 if first else headers.read_array_header_2_0)(file)
        if dtype.kind not in "fiu" or len(shape) not in (2, 3) or not 0 < shape[0] * shape[1] <= MAX_PIXELS:
            raise ValueError(f"its array is of type {dtype} and shape {shape}")
        file.seek(0)
        array = np.load(file, allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise WireError(f"numpy's file of {data.size} bytes cannot be read: {error}") from error
    return np.asarray(array[..., 0] if array.ndim == 3 and array.shape[2] == 1 else array)
