"""The keys of the contract: ROS topic names without the leading slash, below the namespace of one device."""

import re
from dataclasses import dataclass

from odom.errors import ConfigError

TF = "tf"
"""Transforms map -> odom -> camera of every device, each by frame names of its own (tf2_msgs/TFMessage)."""
TRUTH = "truth/*/pose"
"""Key expression of the motion capture poses of all bodies."""
TRUTH_HISTORY = "truth/*/history"
"""Key expression of the earlier poses of all bodies."""

_NAME = re.compile(r"[A-Za-z0-9_]+(/[A-Za-z0-9_]+)*\Z")
_DEFAULT = "cam0"
_LONGEST_BODY = 64
"""Characters of a body's name that its key keeps; longer names that begin alike would share a key."""
_TRUTH_KEY = re.compile(rf"truth/([A-Za-z0-9_]{{1,{_LONGEST_BODY}}})/(?:pose|history)\Z")


def truth(body: str) -> str:
    """Return the key of a motion capture body's pose, with underscores for characters that a key may not hold.

    Only the first 64 characters of a long name are used, and `body` stands for an empty one.
    """
    return f"truth/{_part_of_a_key(body)}/pose"


def truth_history(body: str) -> str:
    """Return the key of a body's earlier poses (nav_msgs/Path), an answer to a query of `Topics.history`."""
    return f"truth/{_part_of_a_key(body)}/history"


def truth_body(key: str) -> str | None:
    """Return the body of a key as `truth` and `truth_history` make it, None for any other key."""
    found = _TRUTH_KEY.match(key)
    return None if found is None else found[1]


def type_of(key: str) -> str | None:
    """Return the message type that the end of a key stands for, None where it says nothing."""
    return _TYPES.get("/".join(key.split("/")[-2:])) or _TYPES.get(key.rpartition("/")[2])


def _part_of_a_key(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_]", "_", name)[:_LONGEST_BODY] or "body"


class _Key:
    """A key below the namespace of a device, and the type of its messages."""

    def __init__(self, name: str, type_name: str = "") -> None:
        self.name, self.type_name = name, type_name

    def __get__(self, topics: "Topics", owner: type) -> str:
        return f"{topics.namespace}/{self.name}"


@dataclass(frozen=True)
class Topics:
    """Keys and frame names of the device `namespace`; raises ConfigError for a name that no ROS topic can have.

    Frames are `map`, `odom` and `cam0_color_optical_frame` for the default device; for any other they are below its
    namespace, as in `cam1/map`: all devices share the key `tf`, and each has a tree of its own there.
    """

    namespace: str = _DEFAULT

    color = _Key("color/image_raw", "sensor_msgs/msg/Image")
    """rgb8."""
    color_compressed = _Key("color/image_raw/compressed", "sensor_msgs/msg/CompressedImage")
    """jpeg or png."""
    depth = _Key("depth/image_raw", "sensor_msgs/msg/Image")
    """16UC1 millimetres, registered to colour."""
    depth_compressed = _Key("depth/image_raw/compressedDepth", "sensor_msgs/msg/CompressedImage")
    """compressedDepth png or RVL."""
    camera_info = _Key("color/camera_info", "sensor_msgs/msg/CameraInfo")
    """Calibration of the colour image, repeated every second for late joiners."""
    depth_info = _Key("depth/camera_info", "sensor_msgs/msg/CameraInfo")
    """The errors of the depth image, where known: sent before each calibration."""
    device = _Key("device", "diagnostic_msgs/msg/DiagnosticArray")
    """The live sensor, every second: name, serial number, lost images."""
    odom = _Key("odom", "nav_msgs/msg/Odometry")
    """The causal pose with covariance, every frame."""
    pose = _Key("pose", "geometry_msgs/msg/PoseStamped")
    """The corrected pose in `map`, every frame."""
    path = _Key("path", "nav_msgs/msg/Path")
    """The corrected key-frame trajectory of the part the camera is in, on change; others below it: `path/segment_N`."""
    chain = _Key("chain", "nav_msgs/msg/Odometry")
    """The paper's chain of pairwise registrations, causal: its pose with the covariance since it began, and as the
    twist the last link: its motion and covariance by the time it took. It begins where `odom` does."""
    chain_closed = _Key("chain/closed", "nav_msgs/msg/Path")
    """Some poses of the chain with its loops closed, at the end of the source."""
    status = _Key("status", "diagnostic_msgs/msg/DiagnosticArray")
    """State, reason, rates, latencies, losses."""
    loops = _Key("loops", "diagnostic_msgs/msg/DiagnosticArray")
    """One message for each loop candidate."""
    features = _Key("features", "sensor_msgs/msg/PointCloud2")
    """For display: tracked features of the frame (u, v, residual_sigma)."""
    moving = _Key("moving", "sensor_msgs/msg/PointCloud2")
    """For display: the squares of the colour image that move (u, v, side_px: middle and side of each)."""
    landmarks = _Key("landmarks", "sensor_msgs/msg/PointCloud2")
    """For display: the sparse map (x, y, z in `map`)."""
    keyframes = _Key("keyframes", "sensor_msgs/msg/PointCloud2")
    """For display: some of the points that a key frame saw (x, y, z, rgb in the camera's frame)."""
    end = _Key("end", "std_msgs/msg/String")
    """The source has ended, with the reason; sent in order behind the last message."""
    history = _Key("history")
    """Query of a process that joins late: the answers are messages with the earlier poses and clouds."""
    odom_history = _Key("history/odom", "nav_msgs/msg/Path")
    """Some of the earlier causal poses; an answer to a query of `history`."""
    chain_history = _Key("history/chain", "nav_msgs/msg/Path")
    """Some of the earlier poses of the chain; an answer to a query of `history`."""
    alive = _Key("alive")
    """Liveliness token of the device's sensor process."""
    ack = _Key("ack")
    """Prefix below which consumers acknowledge what they have consumed (see `odom.wire.send_window`)."""

    def __post_init__(self) -> None:
        if not _NAME.match(self.namespace):
            raise ConfigError(f"namespace {self.namespace!r}: give letters, digits, underscores and inner slashes only")
        if self.namespace.split("/")[0] == "truth":
            raise ConfigError(f"namespace {self.namespace!r}: `truth` is motion capture's; give another name, as cam0")

    @property
    def color_keys(self) -> tuple[str, str]:
        """Both keys of colour images."""
        return self.color, self.color_compressed

    @property
    def depth_keys(self) -> tuple[str, str]:
        """Both keys of depth images."""
        return self.depth, self.depth_compressed

    def alive_of(self, role: str) -> str:
        """Return the liveliness token of another process of this device (`odometry`, `recorder`, `viewer`)."""
        return f"{self.alive}/{role}"

    def ack_of(self, consumer: str) -> str:
        """Return the key on which `consumer` acknowledges; its liveliness token has the same name."""
        return f"{self.ack}/{consumer}"

    @property
    def frame_map(self) -> str:
        """Frame in which loop closures are corrected."""
        return self._frame("map")

    @property
    def frame_odom(self) -> str:
        """Frame in which the causal pose is continuous."""
        return self._frame("odom")

    @property
    def frame_camera(self) -> str:
        """The colour camera's optical frame (z forward)."""
        return self._frame("color_optical_frame") if self.namespace != _DEFAULT else f"{_DEFAULT}_color_optical_frame"

    def _frame(self, name: str) -> str:
        return name if self.namespace == _DEFAULT else f"{self.namespace}/{name}"


_KEYS = [key for key in vars(Topics).values() if isinstance(key, _Key) and key.type_name]
_TYPES = (
    {key.name.rpartition("/")[2]: key.type_name for key in reversed(_KEYS)}  # `odom`, not `history/odom`
    | {key.name: key.type_name for key in _KEYS}
    | {TF: "tf2_msgs/msg/TFMessage"}
)
