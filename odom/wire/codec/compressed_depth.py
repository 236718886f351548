"""The `compressedDepth` transport of ROS: a 12-byte header, then a PNG file or an RVL stream.

RVL: A. D. Wilson, "Fast lossless depth image compression", 2017. 32FC1 depth is stored as quantised inverse depth
with the two parameters a and b of the header: depth = a / (value - b) in metres, value 0 invalid.
"""

from struct import Struct
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.wire.codec.image_files import MAX_PIXELS, decode_file

Depth = NDArray[np.uint16]

_HEADER = Struct("<iff")
_SIZE = Struct("<II")
_INVERSE_DEPTH = 0
"""The number by which compressed_depth_image_transport marks inverse depths."""
_PNG = b"\x89PNG"
_PNG_LEVEL = 1
"""Compression level of PNG, 1 to 9. Larger: slower for little; at 1, 640 x 480 take 12 ms, to a fifth of the size."""


def encode_compressed_depth(depth_mm: Depth, codec: str) -> tuple[str, bytes]:
    """Return (format, data) of H x W millimetres, lossless; `codec` is `rvl` or `png`."""
    header = _HEADER.pack(_INVERSE_DEPTH, 0.0, 0.0)
    if codec == "rvl":
        from odom.wire.codec.rvl import encode_rvl  # compiled: the import takes 0.3 s

        height, width = depth_mm.shape
        return "16UC1; compressedDepth RVL", header + _SIZE.pack(width, height) + encode_rvl(depth_mm.ravel())
    if codec == "png":
        _, data = cv2.imencode(".png", depth_mm, [cv2.IMWRITE_PNG_COMPRESSION, _PNG_LEVEL])
        return "16UC1; compressedDepth png", header + data.tobytes()
    raise WireError(f"depth codec {codec!r}: give rvl or png")


def decode_compressed_depth(image_format: str, data: NDArray[np.uint8]) -> Depth:
    """Return H x W millimetres, 0 invalid; raises WireError for a codec or pixel type that is not known or cut data."""
    if data[:4].tobytes() == _PNG:
        return _millimetres(decode_file(data, cv2.IMREAD_UNCHANGED))
    if data.size < _HEADER.size:
        raise WireError(f"compressed depth of {data.size} bytes ends before its header")
    _, a, b = _HEADER.unpack_from(data.data)
    body = data[_HEADER.size :]
    if body[:4].tobytes() == _PNG:
        values = decode_file(body, cv2.IMREAD_UNCHANGED)
    elif "rvl" in image_format.lower():
        values = _decode_rvl(body)
    else:
        raise WireError(f"compressed depth of format {image_format!r} is neither png nor RVL")
    if image_format.split(";")[0].strip() != "32FC1":
        return _millimetres(values)
    if values.dtype != np.uint16 or values.ndim != 2 or not (np.isfinite((a, b)).all() and a > 0):
        raise WireError(f"inverse depth of type {values.dtype} with parameters {a}, {b} cannot be read")
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        mm = np.rint(1000.0 * a / (values.astype(np.float64) - b))
        return np.where((values > 0) & (mm > 0) & (mm < 65536), mm, 0).astype(np.uint16)


def _decode_rvl(body: NDArray[np.uint8]) -> Depth:
    from odom.wire.codec.rvl import decode_rvl  # compiled: the import takes 0.3 s

    if body.size < _SIZE.size:
        raise WireError("RVL depth ends before its size")
    width, height = _SIZE.unpack_from(body.data)
    if not 0 < width * height <= MAX_PIXELS:
        raise WireError(f"RVL depth of {width} x {height} pixels is not plausible")
    return decode_rvl(body[_SIZE.size :], width * height).reshape(height, width)


def _millimetres(values: NDArray[Any]) -> Depth:
    if values.dtype != np.uint16 or values.ndim != 2:
        raise WireError(f"depth file holds {values.dtype} of shape {values.shape}: expected 16-bit grey")
    return np.asarray(values, dtype=np.uint16)
