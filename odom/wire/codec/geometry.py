"""Poses, covariances, paths, transforms and points as ROS messages.

A covariance in memory follows `odom.registration.se3` (tangent in the SOURCE frame, translation first); ROS's is
that of the position in the parent frame and of rotations about the parent's fixed axes, translation first. To first
order one is the other rotated: `C_ros = diag(R, R) C diag(R, R)^T`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import cdr
from odom.wire.message import Message

Array = NDArray[np.float64]

_FLOAT32 = 7
_MAX_POINTS = 4_000_000


@dataclass(frozen=True, eq=False)
class StampedPose:
    """A pose `T_parent_child` (4 x 4) at `stamp`; `child` is empty where the message does not name it."""

    stamp: Stamp
    parent: str
    child: str
    T_parent_child: Array
    covariance: Array | None = None


def quaternion_from_rotation(R: Array) -> Array:
    """Return the unit quaternion (x, y, z, w), w >= 0, of a rotation matrix.

    The row of 4 q q^T with the largest diagonal element is q without cancellation (S. W. Shepperd, 1978).
    """
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    products = (
        (1 + a - e - i, b + d, c + g, h - f),
        (b + d, 1 - a + e - i, f + h, c - g),
        (c + g, f + h, 1 - a - e + i, d - b),
        (h - f, c - g, d - b, 1 + a + e + i),
    )
    row = np.array(products[max(range(4), key=lambda k: products[k][k])])
    return np.asarray(row / np.copysign(np.sqrt(row @ row), row[3]))


def rotation_from_quaternion(quaternion: Array) -> Array:
    """Return the rotation matrix of (x, y, z, w); raises WireError unless it is finite and about of unit length."""
    x, y, z, w = (float(value) for value in quaternion)
    norm = x * x + y * y + z * z + w * w
    if not 0.98 < norm < 1.02:
        raise WireError(f"quaternion {x, y, z, w} is not of unit length")
    s = 2.0 / norm
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )


def _quaternion(R: Array) -> Any:
    x, y, z, w = (float(value) for value in quaternion_from_rotation(R))
    return cdr.ros("geometry_msgs/msg/Quaternion")(x=x, y=y, z=z, w=w)


def _pose(T: Array) -> Any:
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise WireError(f"a pose needs a finite 4 x 4 matrix, not {T}")
    x, y, z = (float(value) for value in T[:3, 3])
    position = cdr.ros("geometry_msgs/msg/Point")(x=x, y=y, z=z)
    return cdr.ros("geometry_msgs/msg/Pose")(position=position, orientation=_quaternion(T[:3, :3]))


def _matrix(topic: str, position: Any, orientation: Any) -> Array:
    T = np.eye(4)
    T[:3, 3] = position.x, position.y, position.z
    if not np.isfinite(T).all():
        raise WireError(f"{topic}: position {T[:3, 3]} is not finite")
    T[:3, :3] = rotation_from_quaternion(np.array([orientation.x, orientation.y, orientation.z, orientation.w]))
    return T


def _rotate_covariance(R: Array, covariance: Array) -> Array:
    A = np.zeros((6, 6))
    A[:3, :3] = A[3:, 3:] = R
    return np.asarray(A @ covariance @ A.T)


def encode_pose(topic: str, stamp: Stamp, T_parent_child: Array, frame_id: str) -> Message:
    """Return geometry_msgs/PoseStamped of a 4 x 4 pose in frame `frame_id`."""
    message = cdr.ros(cdr.POSE)(header=cdr.header(stamp, frame_id), pose=_pose(T_parent_child))
    return cdr.serialise(topic, cdr.POSE, stamp, message)


def decode_pose(message: Message) -> StampedPose:
    """Return the pose of geometry_msgs/PoseStamped; raises WireError on malformed bytes or values."""
    decoded = cdr.deserialise(message, cdr.POSE)
    T = _matrix(message.topic, decoded.pose.position, decoded.pose.orientation)
    return StampedPose(_stamp(decoded.header), decoded.header.frame_id, "", T)


def encode_odometry(
    topic: str, stamp: Stamp, T_odom_camera: Array, covariance: Array, frame_id: str, child_frame_id: str
) -> Message:
    """Return nav_msgs/Odometry of a pose with its 6 x 6 covariance (`se3` convention); the twist is not known."""
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
        raise WireError(f"a covariance needs a finite 6 x 6 matrix, not {covariance}")
    Vector3 = cdr.ros("geometry_msgs/msg/Vector3")
    zero = Vector3(x=0.0, y=0.0, z=0.0)
    unknown = np.zeros(36)
    unknown[0] = -1.0  # ROS: a covariance that begins with -1 says that the estimate is not provided
    message = cdr.ros(cdr.ODOMETRY)(
        header=cdr.header(stamp, frame_id),
        child_frame_id=child_frame_id,
        pose=cdr.ros("geometry_msgs/msg/PoseWithCovariance")(
            pose=_pose(T_odom_camera), covariance=_rotate_covariance(T_odom_camera[:3, :3], covariance).ravel()
        ),
        twist=cdr.ros("geometry_msgs/msg/TwistWithCovariance")(
            twist=cdr.ros("geometry_msgs/msg/Twist")(linear=zero, angular=zero), covariance=unknown
        ),
    )
    return cdr.serialise(topic, cdr.ODOMETRY, stamp, message)


def decode_odometry(message: Message) -> StampedPose:
    """Return pose and covariance (`se3` convention) of nav_msgs/Odometry; raises WireError on malformed bytes."""
    decoded = cdr.deserialise(message, cdr.ODOMETRY)
    T = _matrix(message.topic, decoded.pose.pose.position, decoded.pose.pose.orientation)
    covariance = np.asarray(decoded.pose.covariance, dtype=np.float64).reshape(6, 6)
    if not np.isfinite(covariance).all():
        raise WireError(f"{message.topic}: covariance is not finite")
    return StampedPose(
        _stamp(decoded.header),
        decoded.header.frame_id,
        decoded.child_frame_id,
        T,
        _rotate_covariance(T[:3, :3].T, covariance),
    )


def encode_path(topic: str, stamp: Stamp, poses: Iterable[tuple[Stamp, Array]], frame_id: str) -> Message:
    """Return nav_msgs/Path of (stamp, `T_frame_camera`)."""
    PoseStamped = cdr.ros(cdr.POSE)
    entries = [PoseStamped(header=cdr.header(at, frame_id), pose=_pose(T)) for at, T in poses]
    message = cdr.ros(cdr.PATH)(header=cdr.header(stamp, frame_id), poses=entries)
    return cdr.serialise(topic, cdr.PATH, stamp, message)


def decode_path(message: Message) -> tuple[StampedPose, ...]:
    """Return the poses of nav_msgs/Path; raises WireError on malformed bytes or values."""
    decoded = cdr.deserialise(message, cdr.PATH)
    return tuple(
        StampedPose(
            _stamp(entry.header),
            entry.header.frame_id,
            "",
            _matrix(message.topic, entry.pose.position, entry.pose.orientation),
        )
        for entry in decoded.poses
    )


def encode_tf(stamp: Stamp, transforms: Iterable[tuple[str, str, Array]], topic: str = "tf") -> Message:
    """Return tf2_msgs/TFMessage of (parent frame, child frame, `T_parent_child`) at one stamp."""
    TransformStamped = cdr.ros("geometry_msgs/msg/TransformStamped")
    Transform, Vector3 = cdr.ros("geometry_msgs/msg/Transform"), cdr.ros("geometry_msgs/msg/Vector3")
    entries = []
    for parent, child, T in transforms:
        pose = _pose(T)
        translation = Vector3(x=pose.position.x, y=pose.position.y, z=pose.position.z)
        transform = Transform(translation=translation, rotation=pose.orientation)
        entries.append(TransformStamped(header=cdr.header(stamp, parent), child_frame_id=child, transform=transform))
    return cdr.serialise(topic, cdr.TRANSFORMS, stamp, cdr.ros(cdr.TRANSFORMS)(transforms=entries))


def decode_tf(message: Message) -> tuple[StampedPose, ...]:
    """Return the transforms of tf2_msgs/TFMessage; raises WireError on malformed bytes or values."""
    decoded = cdr.deserialise(message, cdr.TRANSFORMS)
    return tuple(
        StampedPose(
            _stamp(entry.header),
            entry.header.frame_id,
            entry.child_frame_id,
            _matrix(message.topic, entry.transform.translation, entry.transform.rotation),
        )
        for entry in decoded.transforms
    )


def encode_points(
    topic: str, stamp: Stamp, points: NDArray[np.floating[Any]], frame_id: str, fields: Sequence[str] = ("x", "y", "z")
) -> Message:
    """Return sensor_msgs/PointCloud2 of n x k values, one float32 field a column."""
    values = np.ascontiguousarray(points, dtype=np.float32)
    if values.ndim != 2 or values.shape[1] != len(fields):
        raise WireError(f"points of shape {values.shape} do not have the fields {tuple(fields)}")
    PointField = cdr.ros("sensor_msgs/msg/PointField")
    message = cdr.ros(cdr.POINT_CLOUD)(
        header=cdr.header(stamp, frame_id),
        height=1,
        width=len(values),
        fields=[PointField(name=name, offset=4 * i, datatype=_FLOAT32, count=1) for i, name in enumerate(fields)],
        is_bigendian=False,
        point_step=4 * len(fields),
        row_step=values.nbytes,
        data=values.reshape(-1).view(np.uint8),
        is_dense=bool(np.isfinite(values).all()),
    )
    return cdr.serialise(topic, cdr.POINT_CLOUD, stamp, message)


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


def _stamp(header: Any) -> Stamp:
    if header.stamp.nanosec >= cdr.SECOND:
        raise WireError(f"{header.stamp.nanosec} nanoseconds within a second")
    return Stamp(header.stamp.sec * cdr.SECOND + header.stamp.nanosec)
