"""The CDR bytes of image messages, put together here: `rosbags` copies an image three times, this does it once.

Both types begin with a header and end with their data. Each number is aligned to its own size, counted from behind the
four bytes that say that it is CDR; a string is its length with the zero at its end, and its bytes with that zero.
"""

from struct import Struct

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import cdr

_LITTLE_ENDIAN = b"\0\1\0\0"
_TIME = Struct("<iI")
_NUMBER = Struct("<I")
_NUMBERS = Struct("<II")
_ALIGNMENT = 4
"""Bytes: what follows a string here is a number of 32 bits."""


def image_bytes(
    stamp: Stamp, frame_id: str, size: tuple[int, int], encoding: str, row_bytes: int, pixels: memoryview
) -> bytes:
    """Return sensor_msgs/Image of `size` (height, width), its numbers little-endian, with rows of `row_bytes`."""
    order = b"\0"  # is_bigendian, which follows the string without a gap
    form = _aligned(_string(encoding) + order)
    begin = _header(stamp, frame_id) + _NUMBERS.pack(*size) + form + _NUMBERS.pack(row_bytes, pixels.nbytes)
    return b"".join((begin, pixels))


def compressed_bytes(stamp: Stamp, frame_id: str, image_format: str, file: bytes) -> bytes:
    """Return sensor_msgs/CompressedImage."""
    return b"".join((_header(stamp, frame_id), _aligned(_string(image_format)), _NUMBER.pack(len(file)), file))


def _header(stamp: Stamp, frame_id: str) -> bytes:
    return _LITTLE_ENDIAN + _TIME.pack(*cdr.ros_time(stamp)) + _aligned(_string(frame_id))


def _string(text: str) -> bytes:
    try:
        encoded = text.encode() + b"\0"
    except UnicodeEncodeError as error:
        raise WireError(f"{text!r} cannot be written as UTF-8: {error}") from error
    return _NUMBER.pack(len(encoded)) + encoded


def _aligned(part: bytes) -> bytes:
    return part + bytes(-len(part) % _ALIGNMENT)
