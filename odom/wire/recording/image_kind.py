"""What an image message holds, by its type, its encoding and its topic's name."""

from typing import Literal

from odom.errors import WireError
from odom.wire.codec import cdr, decode_camera_info, decode_color, decode_depth
from odom.wire.codec.image_files import is_deep_grey_png
from odom.wire.message import Message
from odom.wire.recording.topic_words import is_seen

_DEPTH_ENCODINGS, _GREY_16 = ("16UC1", "32FC1"), "mono16"
_IMAGES = (cdr.IMAGE, cdr.COMPRESSED_IMAGE)


def image_kind(message: Message) -> Literal["color", "depth"] | None:
    """Return what an image is of, None when the message is no image.

    Grey in 16 bits is depth unless its topic's name says that a camera sees it.
    """
    try:
        if message.type_name == cdr.IMAGE:
            encoding, is_deep_file = cdr.deserialise(message, cdr.IMAGE).encoding, False
        elif message.type_name == cdr.COMPRESSED_IMAGE:
            image = cdr.deserialise(message, cdr.COMPRESSED_IMAGE)
            if "compresseddepth" in image.format.lower():
                return "depth"
            encoding, is_deep_file = image.format.split(";")[0], is_deep_grey_png(image.data)
        else:
            return None
    except WireError:
        return None
    is_grey_16 = encoding == _GREY_16 or is_deep_file
    return "depth" if encoding in _DEPTH_ENCODINGS or (is_grey_16 and not is_seen(message.topic)) else "color"


def can_be_decoded(message: Message) -> bool:
    """Return whether an image or a calibration is whole and of a known form; other messages are not looked at."""
    kind = image_kind(message)
    try:
        if message.type_name == cdr.CAMERA_INFO:
            decode_camera_info(message)
        elif kind == "depth":
            decode_depth(message)
        elif message.type_name in _IMAGES:
            decode_color(message)
    except WireError:
        return False
    return True


def frame_of(message: Message) -> str:
    """Return the name of the frame that an image or a calibration is in, empty for other and malformed messages."""
    if message.type_name not in (*_IMAGES, cdr.CAMERA_INFO):
        return ""
    try:
        return str(cdr.deserialise(message, message.type_name).header.frame_id).removeprefix("/")
    except WireError:
        return ""
