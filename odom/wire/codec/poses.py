"""Poses, covariances, paths and transforms as ROS messages.

A covariance in memory follows `odom.geometry.se3` (tangent in the SOURCE frame, translation first); ROS's is
that of the position in the parent frame and of rotations about the parent's fixed axes, translation first. To first
order one is the other rotated: `C_ros = diag(R, R) C diag(R, R)^T`.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from odom.errors import InputError, WireError
from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.geometry.quaternion import quaternion_from_rotation, rotation_from_quaternion
from odom.wire.codec import cdr
from odom.wire.message import Message


@dataclass(frozen=True, eq=False)
class StampedPose:
    """A pose `T_parent_child` (4 x 4) at `stamp`; `child` is empty where the message does not name it."""

    stamp: Stamp
    parent: str
    child: str
    T_parent_child: Array
    covariance: Array | None = None


def encode_pose(topic: str, stamp: Stamp, T_parent_child: Array, frame_id: str) -> Message:
    """Return geometry_msgs/PoseStamped of a 4 x 4 pose in frame `frame_id`."""
    return cdr.encode(topic, cdr.POSE, stamp, frame_id, pose=_pose(T_parent_child))


def decode_pose(message: Message) -> StampedPose:
    """Return the pose of geometry_msgs/PoseStamped; raises WireError on malformed bytes or values."""
    return _stamped_pose(message.topic, cdr.deserialise(message, cdr.POSE))


def decode_any_pose(message: Message) -> StampedPose:
    """Return the pose of a message of any type in `cdr.POSES`, without covariance; raises WireError."""
    decoded = cdr.deserialise(message, *cdr.POSES)
    if message.type_name == cdr.POSE:
        return _stamped_pose(message.topic, decoded)
    if message.type_name == cdr.TRANSFORM:
        at, turned = decoded.transform.translation, decoded.transform.rotation
    else:
        at, turned = decoded.pose.pose.position, decoded.pose.pose.orientation
    child = getattr(decoded, "child_frame_id", "")
    T = _matrix(message.topic, at, turned)
    return StampedPose(_stamp(decoded.header), decoded.header.frame_id, child, T)


@dataclass(frozen=True, eq=False)
class Twist:
    """A velocity (6: translation, rotation; m/s and rad/s, child frame) with its 6 x 6 covariance."""

    velocity: Array
    covariance: Array


def encode_odometry(
    topic: str,
    stamp: Stamp,
    T_odom_camera: Array,
    covariance: Array,
    frame_id: str,
    child_frame_id: str,
    twist: Twist | None = None,
) -> Message:
    """Return nav_msgs/Odometry of a pose with its 6 x 6 covariance (`se3` convention); `twist` None: not known."""
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
        raise WireError(f"a covariance needs a finite 6 x 6 matrix, not {covariance}")
    in_ros = _rotate_covariance(T_odom_camera[:3, :3], covariance).ravel()
    velocity, twist_covariance = (np.zeros(6), np.zeros(36)) if twist is None else (twist.velocity, twist.covariance)
    if twist is None:
        twist_covariance[0] = -1.0  # ROS: a covariance that begins with -1 says that the estimate is not provided
    linear, angular = (
        cdr.build("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z)) for x, y, z in velocity.reshape(2, 3)
    )
    in_child = cdr.build("geometry_msgs/msg/Twist", linear=linear, angular=angular)
    return cdr.encode(
        topic,
        cdr.ODOMETRY,
        stamp,
        frame_id,
        child_frame_id=child_frame_id,
        pose=cdr.build("geometry_msgs/msg/PoseWithCovariance", pose=_pose(T_odom_camera), covariance=in_ros),
        twist=cdr.build(
            "geometry_msgs/msg/TwistWithCovariance", twist=in_child, covariance=np.asarray(twist_covariance).ravel()
        ),
    )


def decode_odometry(message: Message) -> StampedPose:
    """Return pose and covariance (`se3` convention) of nav_msgs/Odometry; raises WireError on malformed bytes."""
    decoded = cdr.deserialise(message, cdr.ODOMETRY)
    pose, child = decoded.pose.pose, decoded.child_frame_id
    T = _matrix(message.topic, pose.position, pose.orientation)
    covariance = np.asarray(decoded.pose.covariance, dtype=np.float64).reshape(6, 6)
    if not np.isfinite(covariance).all():
        raise WireError(f"{message.topic}: covariance is not finite")
    in_source = _rotate_covariance(T[:3, :3].T, covariance)
    return StampedPose(_stamp(decoded.header), decoded.header.frame_id, child, T, in_source)


def encode_path(topic: str, stamp: Stamp, poses: Iterable[tuple[Stamp, Array]], frame_id: str) -> Message:
    """Return nav_msgs/Path of (stamp, `T_frame_camera`)."""
    entries = [cdr.build(cdr.POSE, header=cdr.header(at, frame_id), pose=_pose(T)) for at, T in poses]
    return cdr.encode(topic, cdr.PATH, stamp, frame_id, poses=entries)


def decode_path(message: Message) -> tuple[StampedPose, ...]:
    """Return the poses of nav_msgs/Path; raises WireError on malformed bytes or values."""
    return tuple(_stamped_pose(message.topic, entry) for entry in cdr.deserialise(message, cdr.PATH).poses)


def encode_tf(stamp: Stamp, transforms: Iterable[tuple[str, str, Array]], topic: str = "tf") -> Message:
    """Return tf2_msgs/TFMessage of (parent frame, child frame, `T_parent_child`) at one stamp."""
    entries = []
    for parent, child, T in transforms:
        pose = _pose(T)
        at = cdr.build("geometry_msgs/msg/Vector3", x=pose.position.x, y=pose.position.y, z=pose.position.z)
        transform = cdr.build("geometry_msgs/msg/Transform", translation=at, rotation=pose.orientation)
        header = cdr.header(stamp, parent)
        entries.append(
            cdr.build("geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child, transform=transform)
        )
    return cdr.serialise(topic, cdr.TRANSFORMS, stamp, cdr.build(cdr.TRANSFORMS, transforms=entries))


def decode_tf(message: Message) -> tuple[StampedPose, ...]:
    """Return the transforms of tf2_msgs/TFMessage; raises WireError on malformed bytes or values."""
    poses = []
    for entry in cdr.deserialise(message, cdr.TRANSFORMS).transforms:
        T = _matrix(message.topic, entry.transform.translation, entry.transform.rotation)
        poses.append(StampedPose(_stamp(entry.header), entry.header.frame_id, entry.child_frame_id, T))
    return tuple(poses)


def _pose(T: Array) -> Any:
    """Return geometry_msgs/Pose of a 4 x 4 matrix."""
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise WireError(f"a pose needs a finite 4 x 4 matrix, not {T}")
    x, y, z = T[:3, 3].tolist()
    qx, qy, qz, qw = quaternion_from_rotation(T[:3, :3]).tolist()
    position = cdr.build("geometry_msgs/msg/Point", x=x, y=y, z=z)
    orientation = cdr.build("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw)
    return cdr.build("geometry_msgs/msg/Pose", position=position, orientation=orientation)


def _stamped_pose(topic: str, decoded: Any) -> StampedPose:
    """Return the pose of a geometry_msgs/PoseStamped object."""
    T = _matrix(topic, decoded.pose.position, decoded.pose.orientation)
    return StampedPose(_stamp(decoded.header), decoded.header.frame_id, "", T)


def _matrix(topic: str, position: Any, orientation: Any) -> Array:
    T = np.eye(4)
    T[:3, 3] = position.x, position.y, position.z
    if not np.isfinite(T).all():
        raise WireError(f"{topic}: position {T[:3, 3]} is not finite")
    try:
        T[:3, :3] = rotation_from_quaternion(np.array([orientation.x, orientation.y, orientation.z, orientation.w]))
    except InputError as error:
        raise WireError(f"{topic}: {error}") from error
    return T


def _rotate_covariance(R: Array, covariance: Array) -> Array:
    A = np.zeros((6, 6))
    A[:3, :3] = A[3:, 3:] = R
    return np.asarray(A @ covariance @ A.T)


def _stamp(header: Any) -> Stamp:
    if header.stamp.nanosec >= cdr.SECOND:
        raise WireError(f"{header.stamp.nanosec} nanoseconds within a second")
    return Stamp(header.stamp.sec * cdr.SECOND + header.stamp.nanosec)
