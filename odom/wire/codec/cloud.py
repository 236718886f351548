"""Coloured points as ROS packs them: x, y, z in metres, and red, green and blue in the bits of a fourth float."""

import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec.geometry import decode_points, encode_points
from odom.wire.message import Message

_FIELDS = ("x", "y", "z", "rgb")


def encode_cloud(
    topic: str, stamp: Stamp, points: NDArray[np.float32], colors: NDArray[np.uint8], frame_id: str
) -> Message:
    """Return sensor_msgs/PointCloud2 of n x 3 points (metres, frame `frame_id`) with their n x 3 RGB."""
    red, green, blue = colors.astype(np.uint32).T
    rgb = (red << 16 | green << 8 | blue).view(np.float32)
    return encode_points(topic, stamp, np.column_stack([points.astype(np.float32), rgb]), frame_id, _FIELDS)


def decode_cloud(message: Message) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return points (n x 3) and colours (n x 3 RGB) of a PointCloud2 as `encode_cloud` writes it.

    Raises WireError for another layout, points that are not finite or malformed bytes.
    """
    values = decode_points(message)
    if values.shape[1] != len(_FIELDS):
        raise WireError(f"{message.topic}: coloured points need the fields {_FIELDS}, not {values.shape[1]} values")
    if not np.isfinite(values[:, :3]).all():
        raise WireError(f"{message.topic}: points are not finite")
    rgb = np.ascontiguousarray(values[:, 3]).view(np.uint8).reshape(-1, 4)
    return values[:, :3], np.ascontiguousarray(rgb[:, 2::-1])
