"""Turns a live sensor's images into messages, as the options of the source ask."""

from odom.frame import Camera, Stamp
from odom.geometry.arrays import Image
from odom.wire import Message
from odom.wire.codec import (
    encode_calibration,
    encode_color,
    encode_color_jpeg,
    encode_depth,
    encode_depth_compressed,
)
from odom.wire.codec.compressed_depth import Depth
from sensors.source import SourceOptions


class ImageEncoder:
    """Encodes calibration, colour (JPEG or raw) and depth (raw, RVL or PNG) on the keys of the options."""

    def __init__(self, options: SourceOptions, jpeg_quality: int = 90) -> None:
        self._options = options
        self._frame_id = options.topics.frame_camera
        self._jpeg_quality = jpeg_quality

    def info(self, stamp: Stamp, camera: Camera) -> tuple[Message, ...]:
        """Return the messages of the calibration."""
        topics = self._options.topics
        return encode_calibration((topics.camera_info, topics.depth_info), stamp, camera, self._frame_id)

    def color(self, stamp: Stamp, rgb: Image) -> Message:
        """Return the message of a colour image (H x W x 3)."""
        topics = self._options.topics
        if self._options.color == "raw":
            return encode_color(topics.color, stamp, rgb, self._frame_id)
        return encode_color_jpeg(topics.color_compressed, stamp, rgb, self._frame_id, self._jpeg_quality)

    def depth(self, stamp: Stamp, depth_mm: Depth) -> Message:
        """Return the message of a depth image (H x W uint16, mm)."""
        topics, codec = self._options.topics, self._options.depth
        if codec == "raw":
            return encode_depth(topics.depth, stamp, depth_mm, self._frame_id)
        return encode_depth_compressed(topics.depth_compressed, stamp, depth_mm, self._frame_id, codec)
