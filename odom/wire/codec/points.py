"""Points with further values, such as colours, as sensor_msgs/PointCloud2: every field a float32, packed."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import cdr
from odom.wire.message import Message

_FLOAT32 = 7
"""The type's number in sensor_msgs/PointField."""
_MAX_POINTS = 4_000_000
"""Points beyond which a cloud is refused: far more than an image has pixels. Larger: a message with a false size could
take more memory (16 bytes a coloured point)."""
_COLORED = ("x", "y", "z", "rgb")


def encode_points(
    topic: str, stamp: Stamp, points: NDArray[np.floating[Any]], frame_id: str, fields: Sequence[str] = ("x", "y", "z")
) -> Message:
    """Return sensor_msgs/PointCloud2 of n x k values, one float32 field per column."""
    values = np.ascontiguousarray(points, dtype=np.float32)
    if values.ndim != 2 or values.shape[1] != len(fields):
        raise WireError(f"points of shape {values.shape} do not have the fields {tuple(fields)}")
    described = [
        cdr.build("sensor_msgs/msg/PointField", name=name, offset=4 * i, datatype=_FLOAT32, count=1)
        for i, name in enumerate(fields)
    ]
    return cdr.encode(
        topic,
        cdr.POINT_CLOUD,
        stamp,
        frame_id,
        height=1,
        width=len(values),
        fields=described,
        is_bigendian=False,
        point_step=4 * len(fields),
        row_step=values.nbytes,
        data=values.reshape(-1).view(np.uint8),
        is_dense=bool(np.isfinite(values).all()),
    )


def decode_points(message: Message) -> NDArray[np.float32]:
    """Return the n x k values of a PointCloud2 whose fields are all packed float32 (as `encode_points` writes).

    Raises WireError for another layout or malformed bytes.
    """
    decoded = cdr.deserialise(message, cdr.POINT_CLOUD)
    columns, rows = len(decoded.fields), decoded.width * decoded.height
    packed = all(entry.datatype == _FLOAT32 and entry.offset == 4 * i for i, entry in enumerate(decoded.fields))
    if not packed or columns == 0 or decoded.is_bigendian or decoded.point_step != 4 * columns or rows > _MAX_POINTS:
        raise WireError(f"{message.topic}: points are not packed little-endian float32")
    if decoded.data.size != 4 * columns * rows:
        raise WireError(f"{message.topic}: {decoded.data.size} bytes for {rows} points of {columns} values")
    return np.frombuffer(decoded.data.tobytes(), dtype="<f4").reshape(rows, columns)


def encode_cloud(
    topic: str, stamp: Stamp, points: NDArray[np.float32], colors: NDArray[np.uint8], frame_id: str
) -> Message:
    """Return sensor_msgs/PointCloud2 of n x 3 points (metres, frame `frame_id`) with their n x 3 RGB.

    As ROS does it, red, green and blue are the bits of a fourth float.
    """
    red, green, blue = colors.astype(np.uint32).T
    rgb = (red << 16 | green << 8 | blue).view(np.float32)
    return encode_points(topic, stamp, np.column_stack([points.astype(np.float32), rgb]), frame_id, _COLORED)


def decode_cloud(message: Message) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Return points (n x 3) and colours (n x 3 RGB) of a PointCloud2 as `encode_cloud` writes it.

    Raises WireError for another layout, points that are not finite or malformed bytes.
    """
    values = decode_points(message)
    if values.shape[1] != len(_COLORED):
        raise WireError(f"{message.topic}: coloured points need the fields {_COLORED}, not {values.shape[1]} values")
    if not np.isfinite(values[:, :3]).all():
        raise WireError(f"{message.topic}: points are not finite")
    rgb = np.ascontiguousarray(values[:, 3]).view(np.uint8).reshape(-1, 4)
    return values[:, :3], np.ascontiguousarray(rgb[:, 2::-1])
