"""Colour and depth images as ROS messages.

A raw image is copied only once, into the message: a decoded image is a read-only view of the payload wherever its
encoding allows.
"""

from collections.abc import Callable, Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.frame import Stamp
from odom.geometry.arrays import Image
from odom.wire.codec import cdr
from odom.wire.codec.compressed_depth import Depth, decode_compressed_depth, encode_compressed_depth
from odom.wire.codec.deep_images import in_eight_bits
from odom.wire.codec.image_files import MAX_PIXELS, OtherFormatError, decode_file, decode_file_small
from odom.wire.codec.image_layout import compressed_bytes, image_bytes
from odom.wire.message import Message

OPTICAL_FRAME = "camera_color_optical_frame"

_FLOAT_MILLIMETRES = (
    "float depth (32FC1) looks like millimetres, where ROS has metres: divide it by 1000, or publish it as 16UC1"
)
"""What is wrong with a float image of depth in another unit."""
_HARDLY_ANY = 0.01
"""Share of pixels within 65 m below which the unit of a float image is looked at; more is an image of metres."""
_MOST_OF, _FARTHEST_MM = (0.1, 0.9), 20_000.0
"""Quantiles of such an image between which it must change, and the largest that the upper one may be, in millimetres:
no depth camera sees farther than 20 m."""

_COLOR_ENCODINGS: Mapping[str, tuple[int, int | None]] = {
    "rgb8": (3, None),
    "bgr8": (3, cv2.COLOR_BGR2RGB),
    "8UC3": (3, cv2.COLOR_BGR2RGB),
    "rgba8": (4, cv2.COLOR_RGBA2RGB),
    "bgra8": (4, cv2.COLOR_BGRA2RGB),
    "8UC4": (4, cv2.COLOR_BGRA2RGB),
    "mono8": (1, None),
    "8UC1": (1, None),
    "yuv422": (2, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2RGB_YUY2),
    "yuyv": (2, cv2.COLOR_YUV2RGB_YUY2),
    # OpenCV names a Bayer pattern by its second row, ROS by its first
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2RGB),
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2RGB),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2RGB),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2RGB),
}
"""ROS's name of a pixel format: bytes a pixel, and OpenCV's conversion to RGB (None: nothing to convert)."""


def encode_color(topic: str, stamp: Stamp, color: Image, frame_id: str = OPTICAL_FRAME) -> Message:
    """Return sensor_msgs/Image: `color` is H x W x 3 uint8 RGB or H x W grey."""
    if color.dtype != np.uint8 or color.ndim not in (2, 3) or (color.ndim == 3 and color.shape[2] != 3):
        raise WireError(f"colour is {color.dtype} of shape {color.shape}: give uint8, H x W x 3 or H x W")
    return _encode_image(topic, stamp, color, "rgb8" if color.ndim == 3 else "mono8", frame_id)


def encode_color_jpeg(
    topic: str, stamp: Stamp, color: Image, frame_id: str = OPTICAL_FRAME, quality: int = 90
) -> Message:
    """Return sensor_msgs/CompressedImage (jpeg, quality 1 to 100) of H x W x 3 RGB or H x W grey."""
    bgr = cv2.cvtColor(color, cv2.COLOR_RGB2BGR) if color.ndim == 3 else color
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return encode_color_file(topic, stamp, data.tobytes(), frame_id)


def encode_color_file(topic: str, stamp: Stamp, file: bytes, frame_id: str = OPTICAL_FRAME) -> Message:
    """Return sensor_msgs/CompressedImage that carries the bytes of a JPEG or PNG file unchanged.

    Raises OtherFormatError when it is neither.
    """
    if file.startswith(b"\xff\xd8"):
        image_format = "rgb8; jpeg compressed bgr8"
    elif file.startswith(b"\x89PNG"):
        image_format = "rgb8; png compressed bgr8"
    else:
        raise OtherFormatError("the colour file is neither JPEG nor PNG")
    return _encode_compressed(topic, stamp, image_format, file, frame_id)


def encode_depth(topic: str, stamp: Stamp, depth_mm: Depth, frame_id: str = OPTICAL_FRAME) -> Message:
    """Return sensor_msgs/Image 16UC1 of H x W uint16 millimetres, 0 invalid (REP-118)."""
    _check_depth(depth_mm)
    return _encode_image(topic, stamp, depth_mm, "16UC1", frame_id)


def encode_depth_compressed(
    topic: str, stamp: Stamp, depth_mm: Depth, frame_id: str = OPTICAL_FRAME, codec: str = "rvl"
) -> Message:
    """Return sensor_msgs/CompressedImage with lossless depth, `codec` `rvl` (fast) or `png` (smaller)."""
    _check_depth(depth_mm)
    image_format, data = encode_compressed_depth(depth_mm, codec)
    return _encode_compressed(topic, stamp, image_format, data, frame_id)


def decode_color(message: Message, grey: bool = False) -> Image:
    """Return H x W x 3 RGB, or H x W grey if asked for (cheaper for JPEG) or if the image has no colour.

    Takes sensor_msgs/Image of every common 8-bit encoding and of mono16, and CompressedImage of JPEG or PNG files; of
    16 bits a sample the upper eight in use (see `in_eight_bits`). Raises WireError for anything else, cut or malformed.
    """
    if message.type_name == cdr.COMPRESSED_IMAGE:
        decoded = cdr.deserialise(message, cdr.COMPRESSED_IMAGE)
        how = cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR_RGB
        image = decode_file(decoded.data, how | cv2.IMREAD_ANYDEPTH)
        if image.dtype not in (np.uint8, np.uint16):
            raise WireError(f"{message.topic}: colour of type {image.dtype}")
        return in_eight_bits(image)
    decoded = cdr.deserialise(message, cdr.IMAGE)
    if decoded.encoding == "mono16":
        return in_eight_bits(_numbers(message.topic, decoded, "u2"))
    if decoded.encoding not in _COLOR_ENCODINGS:
        raise WireError(f"{message.topic}: colour encoding {decoded.encoding!r} is not known")
    pixel_bytes, to_rgb = _COLOR_ENCODINGS[decoded.encoding]
    image = _pixels(message.topic, decoded, pixel_bytes)
    if to_rgb is not None:
        image = _convert(message.topic, image, to_rgb)
    if grey and image.ndim == 3:
        image = _convert(message.topic, image, cv2.COLOR_RGB2GRAY)
    return image


def decode_color_small(message: Message, width: int) -> Image:
    """Return H x W x 3 RGB, a JPEG or PNG file scaled down by up to 8 but not below `width`: quicker than full size."""
    if message.type_name != cdr.COMPRESSED_IMAGE:
        return decode_color(message)
    image = decode_file_small(cdr.deserialise(message, cdr.COMPRESSED_IMAGE).data, width)
    return _convert(message.topic, in_eight_bits(image), cv2.COLOR_BGR2RGB)


def decode_depth(message: Message) -> Depth:
    """Return H x W uint16 millimetres, 0 invalid.

    Takes sensor_msgs/Image 16UC1 or mono16 (millimetres) and 32FC1 (metres; not finite, negative or beyond 65.535 m
    becomes 0), and CompressedImage of compressedDepth (png or RVL, 16UC1 or 32FC1) or of a 16-bit PNG file. Raises
    WireError for anything else, cut or malformed, and for 32FC1 that holds millimetres.
    """
    if message.type_name == cdr.COMPRESSED_IMAGE:
        decoded = cdr.deserialise(message, cdr.COMPRESSED_IMAGE)
        return decode_compressed_depth(decoded.format, decoded.data)
    decoded = cdr.deserialise(message, cdr.IMAGE)
    if decoded.encoding in ("16UC1", "mono16"):
        return np.asarray(_numbers(message.topic, decoded, "u2"), dtype=np.uint16)
    if decoded.encoding == "32FC1":
        return metres_to_mm(_numbers(message.topic, decoded, "f4"))
    raise WireError(f"{message.topic}: depth encoding {decoded.encoding!r} is not known")


def metres_to_mm(depth_m: NDArray[Any]) -> Depth:
    """Return millimetres as `rounded_mm` does; raises WireError where hardly any are left of millimetres."""
    found = rounded_mm(depth_m)
    if np.count_nonzero(found) < _HARDLY_ANY * found.size and _is_in_millimetres(depth_m):
        raise WireError(_FLOAT_MILLIMETRES)
    return found


def rounded_mm(depth_m: NDArray[Any]) -> Depth:
    """Return millimetres, rounded once; what is not finite, not positive or beyond 65.535 m becomes 0."""
    with np.errstate(invalid="ignore", over="ignore"):
        mm = np.rint(depth_m.astype(np.float64) * 1000.0)
        return np.where((mm > 0) & (mm < 65536), mm, 0).astype(np.uint16)


def _is_in_millimetres(values: NDArray[Any]) -> bool:
    """Return whether values beyond 65.535 are depths in millimetres: different ones, and within a camera's range.

    A simulator's value for nothing in sight is the same everywhere.
    """
    some = values[np.isfinite(values) & (values > 0)]
    if not some.size:
        return False
    low, high = np.quantile(some, _MOST_OF)
    return bool(low < high < _FARTHEST_MM)


def _encode_image(topic: str, stamp: Stamp, image: NDArray[Any], encoding: str, frame_id: str) -> Message:
    pixels = np.ascontiguousarray(image)
    height, width = image.shape[:2]
    payload = image_bytes(
        stamp, frame_id, (height, width), encoding, pixels.strides[0], pixels.reshape(-1).view(np.uint8).data
    )
    return Message(topic, cdr.IMAGE, stamp, payload)


def _encode_compressed(topic: str, stamp: Stamp, image_format: str, data: bytes, frame_id: str) -> Message:
    return Message(topic, cdr.COMPRESSED_IMAGE, stamp, compressed_bytes(stamp, frame_id, image_format, data))


def _check_depth(depth_mm: Depth) -> None:
    if depth_mm.dtype != np.uint16 or depth_mm.ndim != 2:
        raise WireError(f"depth is {depth_mm.dtype} of shape {depth_mm.shape}: give uint16, H x W")


def _numbers(topic: str, decoded: Any, kind: str) -> NDArray[Any]:
    """Return the H x W view of an image message's data as numbers of numpy's `kind`, in the message's byte order."""
    order = ">" if decoded.is_bigendian else "<"
    return _pixels(topic, decoded, np.dtype(kind).itemsize).view(order + kind)[..., 0]


def _pixels(topic: str, decoded: Any, pixel_bytes: int) -> NDArray[np.uint8]:
    """Return the H x W (x bytes, if more than one) view of an image message's data, without the padding of rows."""
    height, width, step = decoded.height, decoded.width, decoded.step
    row = width * pixel_bytes
    if not 0 < height * width <= MAX_PIXELS:
        raise WireError(f"{topic}: image size {width} x {height} is not plausible")
    if step < row or decoded.data.size != step * height:
        raise WireError(f"{topic}: {decoded.data.size} bytes in rows of {step} do not hold {width} x {height} pixels")
    rows: NDArray[np.uint8] = decoded.data.reshape(height, step)[:, :row]
    return rows if pixel_bytes == 1 else rows.reshape(height, width, pixel_bytes)


def _convert(topic: str, image: NDArray[np.uint8], code: int) -> NDArray[np.uint8]:
    convert: Callable[..., Any] = cv2.cvtColor
    try:
        return np.asarray(convert(image, code), dtype=np.uint8)
    except cv2.error as error:
        raise WireError(f"{topic}: image of shape {image.shape} cannot be converted: {error}") from error
