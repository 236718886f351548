"""16-bit grey PNG files, as folders keep depth in: read in half the time that libpng takes.

ISA-L inflates at three times zlib's speed, and one compiled loop undoes the filters of the rows and looks each value up
in a table: a folder's units become millimetres (PNG, ISO/IEC 15948, clauses 5, 9 and 11.2). Loading it takes .4 s of
CPU, so it is for many images; `decode_file` is for a few.
"""

from struct import Struct

import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from odom.errors import WireError
from odom.geometry.compiled import compiled
from odom.wire.codec.image_files import MAX_PIXELS, PNG_BEGIN, png_chunks

_HEADER = Struct(">8sI4sIIBBBBB")
_GREY_16 = (16, 0, 0, 0, 0)
"""Bit depth, colour type, compression, filter and interlace method of the files that are read here."""
_SUB, _UP, _AVERAGE, _PAETH = 1, 2, 3, 4
"""The filters' numbers: a byte is kept as its difference to the left one, the one above, the mean of both, or to the
nearest of three (see `_predicted`); 0: as it is."""


def is_depth_png(data: NDArray[np.uint8]) -> bool:
    """Return whether a file begins as a PNG of 16-bit grey that is not interlaced."""
    if data.size < _HEADER.size:
        return False
    signature, length, kind, _, _, *form = _HEADER.unpack_from(data.data)
    return (signature, length, kind, *form) == (PNG_BEGIN, 13, b"IHDR", *_GREY_16)


def decode_depth_png(data: NDArray[np.uint8], table: NDArray[np.uint16] | None = None) -> NDArray[np.uint16]:
    """Return the H x W values of a file of which `is_depth_png` says yes, each looked up in the `table` (65536).

    Raises WireError when it is cut, damaged or too large.
    """
    width, height = _HEADER.unpack_from(data.data)[3:5]
    if not 0 < width * height <= MAX_PIXELS:
        raise WireError(f"image of {width} x {height} pixels is not plausible")
    row = 2 * width + 1
    image = [content for kind, content in png_chunks(data.data) if kind == b"IDAT"]
    inflater = isal_zlib.decompressobj()
    try:
        rows = inflater.decompress(b"".join(image), height * row + 1)
    except isal_zlib.error as error:  # type: ignore[misc]  # isal's stub calls it a value
        raise WireError(f"image file of {data.size} bytes is damaged: {error}") from error
    values = np.empty((height, width), dtype=np.uint16)
    known = np.arange(65536, dtype=np.uint16) if table is None else table
    is_whole = len(rows) == height * row and inflater.eof
    if not (is_whole and _unfilter(np.frombuffer(rows, dtype=np.uint8).reshape(height, row), known, values)):
        raise WireError(f"image file of {data.size} bytes is cut or damaged")
    return values


@compiled
def _predicted(left: int, above: int, corner: int) -> int:
    """Return the one of three neighbours that is nearest to left + above - corner (A. W. Paeth, 1991)."""
    to_left, to_above = abs(above - corner), abs(left - corner)
    to_corner = abs(left + above - 2 * corner)
    if to_left <= to_above and to_left <= to_corner:
        return left
    return above if to_above <= to_corner else corner


@compiled
def _unfilter(rows: NDArray[np.uint8], table: NDArray[np.uint16], values: NDArray[np.uint16]) -> bool:
    """Fill `values` (H x W) from rows of a filter's number and 2 W filtered bytes; False for a filter that is unknown.

    High and low bytes are filtered separately; `above` holds both of the row before.
    """
    height, width = values.shape
    above = np.zeros((width, 2), dtype=np.int32)
    for v in range(height):
        row, kind = rows[v], rows[v, 0]
        if kind > _PAETH:
            return False
        high, low, corner_high, corner_low = 0, 0, 0, 0
        for u in range(width):
            above_high, above_low = int(above[u, 0]), int(above[u, 1])
            if kind == _PAETH:
                high = _predicted(high, above_high, corner_high)
                low = _predicted(low, above_low, corner_low)
            elif kind == _UP:
                high, low = above_high, above_low
            elif kind == _AVERAGE:
                high, low = (high + above_high) >> 1, (low + above_low) >> 1
            elif kind != _SUB:
                high, low = 0, 0
            high, low = (high + row[2 * u + 1]) & 255, (low + row[2 * u + 2]) & 255
            corner_high, corner_low = above_high, above_low
            above[u, 0], above[u, 1] = high, low
            values[v, u] = table[(high << 8) | low]
    return True
