"""ROS 2 messages as CDR bytes, through `rosbags`; whatever is wrong with the bytes becomes a WireError.

Only the stamp is read and written here, at its fixed place, because `rosbags` would decode the whole message for it.
"""

from functools import lru_cache
from pathlib import Path
from struct import Struct
from typing import Any

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.message import Message

SECOND = 1_000_000_000
"""Nanoseconds in a second."""

STRING = "std_msgs/msg/String"
NUMBERS = "std_msgs/msg/UInt64MultiArray"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
POSE = "geometry_msgs/msg/PoseStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
PATH = "nav_msgs/msg/Path"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORM = "geometry_msgs/msg/TransformStamped"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

POSES = (POSE, ODOMETRY, POSE_COVARIANCE, TRANSFORM)
"""Types of one pose a message, of a body in a frame that its header names."""
_BEGIN_WITH_A_HEADER = (IMAGE, COMPRESSED_IMAGE, CAMERA_INFO, POINT_CLOUD, *POSES, PATH, DIAGNOSTICS)
_STAMP_OFFSET = dict.fromkeys(_BEGIN_WITH_A_HEADER, 4) | {TRANSFORMS: 8}
"""Where the stamp stands: behind the 4 bytes of CDR, in TRANSFORMS also behind the length of its sequence."""
_TIME = {0: Struct(">iI"), 1: Struct("<iI")}
"""Layout of a stamp by the second byte of the payload, which says the byte order."""


def typestore(type_name: str) -> Any:
    """Return a store of definitions with this type, if ROS 2 defines it (no type: `rosbags` generates its classes)."""
    own = _own_types()
    return own if type_name in own.types else _all_types()


@lru_cache(maxsize=1)
def _own_types() -> Any:
    """Return the store of the types that this project sends: `rosbags` takes a fifth of the time for them alone."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    first, rest = Path(__file__).with_name("messages.msg").read_text().removeprefix("MSG: ").split("\n", 1)
    store.register(get_types_from_msg(rest, first))
    return store


@lru_cache(maxsize=1)
def _all_types() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def build(type_name: str, *values: Any, **fields: Any) -> Any:
    """Return a `rosbags` message object, such as `build("geometry_msgs/msg/Point", x=0.0, y=0.0, z=1.0)`.

    Raises WireError for a type that ROS 2 does not define.
    """
    return _message_class(type_name)(*values, **fields)


@lru_cache(maxsize=64)
def schema(type_name: str) -> bytes:
    """Return the message definition (`ros2msg`) that a recording stores beside the messages."""
    _message_class(type_name)
    return str(typestore(type_name).generate_msgdef(type_name, ros_version=2)[0]).encode()


def header(stamp: Stamp, frame_id: str) -> Any:
    """Return std_msgs/Header; raises WireError for a stamp beyond the years 1901 to 2038."""
    seconds, nanoseconds = ros_time(stamp)
    time = build("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return build("std_msgs/msg/Header", stamp=time, frame_id=frame_id)


def stamp_of(type_name: str, payload: bytes) -> Stamp | None:
    """Return the capture stamp of a serialised message without decoding the rest, None for types without one.

    Raises WireError when the bytes end before the stamp or it is not a time.
    """
    offset = _STAMP_OFFSET.get(type_name)
    if offset is None:
        return None
    if len(payload) < offset + 8:
        if type_name == TRANSFORMS and len(payload) == 8 and payload[4:] == b"\0\0\0\0":
            return None
        raise WireError(f"{type_name} of {len(payload)} bytes ends before its stamp")
    if payload[0] != 0 or payload[1] not in _TIME:
        raise WireError(f"{type_name} does not begin with a CDR header")
    seconds, nanoseconds = _TIME[payload[1]].unpack_from(payload, offset)
    if nanoseconds >= SECOND:
        raise WireError(f"{type_name} carries {nanoseconds} nanoseconds within a second")
    return Stamp(seconds * SECOND + nanoseconds)


def restamp(message: Message, stamp: Stamp) -> Message:
    """Return the message with another capture stamp and all else unchanged.

    Raises WireError for a type without a stamp, malformed bytes and a stamp beyond the years 1901 to 2038.
    """
    if stamp_of(message.type_name, message.payload) is None:
        raise WireError(f"{message.type_name} has no stamp")
    payload = bytearray(message.payload)
    _TIME[payload[1]].pack_into(payload, _STAMP_OFFSET[message.type_name], *ros_time(stamp))
    return Message(message.topic, message.type_name, stamp, bytes(payload))


def encode(topic: str, type_name: str, stamp: Stamp, frame_id: str, **fields: Any) -> Message:
    """Return the wire message of a type that begins with a header; raises WireError as `serialise` does."""
    message = build(type_name, header=header(stamp, frame_id), **fields)
    return serialise(topic, type_name, stamp, message)


def serialise(topic: str, type_name: str, stamp: Stamp, message: Any) -> Message:
    """Return the wire message of a `rosbags` message object; raises WireError when a field does not fit its type."""
    try:
        payload = bytes(typestore(type_name).serialize_cdr(message, type_name, little_endian=True))
    except Exception as error:  # whatever the generated code raises for a value out of range
        raise WireError(f"{type_name} for {topic} cannot be serialised: {error}") from error
    return Message(topic, type_name, stamp, payload)


def deserialise(message: Message, *type_names: str) -> Any:
    """Return the `rosbags` message object; arrays in it are read-only views of the payload.

    Raises WireError when the type is none of `type_names` or the bytes are malformed.
    """
    if message.type_name not in type_names:
        raise WireError(f"{message.topic} carries {message.type_name}, expected {' or '.join(type_names)}")
    stamp_of(message.type_name, message.payload)
    try:
        return typestore(message.type_name).deserialize_cdr(memoryview(message.payload), message.type_name)
    except Exception as error:  # the generated code meets arbitrary bytes
        raise WireError(f"{message.topic}: malformed {message.type_name}: {error}") from error


@lru_cache(maxsize=64)
def _message_class(type_name: str) -> Any:
    try:
        return typestore(type_name).types[type_name]
    except KeyError:
        raise WireError(f"message type {type_name!r} is not known") from None


def ros_time(stamp: Stamp) -> tuple[int, int]:
    """Return the seconds and nanoseconds of a ROS time."""
    seconds, nanoseconds = divmod(stamp, SECOND)
    if not -(2**31) <= seconds < 2**31:
        raise WireError(f"stamp {stamp} does not fit a ROS time: give nanoseconds between 1901 and 2038")
    return seconds, nanoseconds
