"""JPEG and PNG files in memory: decoded only after their size and completeness are known."""

import zlib
from collections import deque
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError

MAX_PIXELS = 16_777_216
"""Pixels beyond which an image is refused (4096 x 4096). Larger: a message with a false size may take more memory."""

_JPEG_BEGIN, _JPEG_END = b"\xff\xd8", b"\xff\xd9"
PNG_BEGIN, _PNG_LAST = b"\x89PNG\r\n\x1a\n", b"IEND"
_DEEP_GREY = b"\x10\x00"
"""Bits a sample and kind of colour in a PNG's header (ISO/IEC 15948, 11.2.2): 16 bits of grey."""
_NO_LENGTH = frozenset((0x01, *range(0xD0, 0xD9)))
_FRAME = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of JPEG (ITU-T T.81, table B.1): those without a length, and those whose segment holds the image's size."""
_PADDING = 64
"""Bytes behind the end mark of a JPEG file that are still accepted, besides any number of zeros: cameras pad files."""
_REDUCED = {8: cv2.IMREAD_REDUCED_COLOR_8, 4: cv2.IMREAD_REDUCED_COLOR_4, 2: cv2.IMREAD_REDUCED_COLOR_2}
"""Factors by which a JPEG can be scaled down while it is decoded, and OpenCV's flags; the largest first."""


class OtherFormatError(WireError):
    """Data that begin neither as a JPEG nor as a PNG file, or hold numbers that are no shades."""


def file_size(data: bytes | memoryview) -> tuple[int, int]:
    """Return (width, height) from the header of a JPEG or PNG file.

    Raises OtherFormatError when it is neither, WireError when it is cut or damaged, or holds more than `MAX_PIXELS`
    pixels.
    """
    view = memoryview(data)
    begin = bytes(view[:8])
    is_png = begin == PNG_BEGIN and len(view) >= 33
    if is_png:
        width, height = int.from_bytes(view[16:20], "big"), int.from_bytes(view[20:24], "big")
    elif begin.startswith(_JPEG_BEGIN):
        width, height = _jpeg_size(view)
    else:
        raise OtherFormatError("image data is neither a JPEG nor a PNG file")
    if not 0 < width * height <= MAX_PIXELS:
        raise WireError(f"image of {width} x {height} pixels is not plausible")
    if is_png:
        deque(png_chunks(view), maxlen=0)  # all of them are whole
    elif not _is_whole_jpeg(view):
        raise WireError(f"image file of {len(view)} bytes is cut or damaged")
    return width, height


def png_chunks(view: memoryview) -> Iterator[tuple[bytes, memoryview]]:
    """Yield the kind and the content of a PNG file's chunks, up to the last.

    Raises WireError where one is cut or its checksum is wrong, which libpng reports only on stderr.
    """
    at = len(PNG_BEGIN)
    while at + 12 <= len(view):
        kind, end = bytes(view[at + 4 : at + 8]), at + 8 + int.from_bytes(view[at : at + 4], "big")
        if end + 4 > len(view) or zlib.crc32(view[at + 4 : end]) != int.from_bytes(view[end : end + 4], "big"):
            break
        yield kind, view[at + 8 : end]
        if kind == _PNG_LAST:
            return
        at = end + 4
    raise WireError(f"image file of {len(view)} bytes is cut or damaged")


def is_deep_grey_png(data: NDArray[np.uint8]) -> bool:
    """Return whether the header of a file is that of a PNG of grey in 16 bits, as depth is stored."""
    return data[:8].tobytes() == PNG_BEGIN and data[24:26].tobytes() == _DEEP_GREY


def decode_file(data: NDArray[np.uint8], flags: int) -> NDArray[Any]:
    """Return the image of a JPEG or PNG file (`cv2.imdecode` with `flags`, EXIF orientation ignored).

    Raises WireError when the file is cut, too large or malformed.
    """
    return _decode(data, file_size(data.data), flags)


def decode_file_small(data: NDArray[np.uint8], width: int) -> NDArray[Any]:
    """Return H x W x 3 BGR at the smallest of full, 1/2, 1/4 or 1/8 size that is at least `width` wide.

    It is of 16 bits a sample where the file is. Raises WireError as `decode_file` does.
    """
    size = file_size(data.data)
    reduction = next((by for by in _REDUCED if size[0] // by >= width), 1)
    reduced = -(-size[0] // reduction), -(-size[1] // reduction)
    return _decode(data, reduced, _REDUCED.get(reduction, cv2.IMREAD_COLOR) | cv2.IMREAD_ANYDEPTH)


def _decode(data: NDArray[np.uint8], size: tuple[int, int], flags: int) -> NDArray[Any]:
    try:
        image = cv2.imdecode(data, flags | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise WireError(f"image file cannot be decoded: {error}") from error
    if image is None or image.shape[1::-1] != size:
        raise WireError(f"image file of {data.size} bytes cannot be decoded")
    return np.asarray(image)


def _is_whole_jpeg(view: memoryview) -> bool:
    """Return whether the end mark of a JPEG file is at its end, before a few bytes or any number of zeros."""
    last = bytes(view[-len(_JPEG_END) - _PADDING :])
    return _JPEG_END in last or bytes(view).rstrip(b"\0").endswith(_JPEG_END)


def _jpeg_size(view: memoryview) -> tuple[int, int]:
    at = 2
    while at + 9 < len(view):
        if view[at] != 0xFF:
            break
        marker = view[at + 1]
        if marker == 0xFF:
            at += 1
        elif marker in _NO_LENGTH:
            at += 2
        elif marker in _FRAME:
            return int.from_bytes(view[at + 7 : at + 9], "big"), int.from_bytes(view[at + 5 : at + 7], "big")
        else:
            at += 2 + max(2, int.from_bytes(view[at + 2 : at + 4], "big"))
    raise WireError("JPEG file without a frame header")
