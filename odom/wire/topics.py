"""The keys of the contract: ROS topic names without the leading slash, below the namespace of one device."""

import re
from dataclasses import dataclass

from odom.errors import ConfigError

TF = "tf"
"""Transforms map -> odom -> camera of every device, each by frame names of its own (tf2_msgs/TFMessage)."""
TRUTH = "truth/*/pose"
"""Key expression of the motion capture poses of all bodies."""
TRUTH_HISTORY = "truth/*/history"
"""Key expression of what is remembered of all bodies."""

_NAME = re.compile(r"[A-Za-z0-9_]+(/[A-Za-z0-9_]+)*\Z")
_DEFAULT = "cam0"
_LONGEST_BODY = 64
_TRUTH_KEY = re.compile(rf"truth/([A-Za-z0-9_]{{1,{_LONGEST_BODY}}})/(?:pose|history)\Z")


def truth(body: str) -> str:
    """Return the key of a motion capture body's pose; what a key may not hold becomes an underscore.

    Of a long name the first 64 characters are taken, and `body` for none.
    """
    return f"truth/{_part_of_a_key(body)}/pose"


def truth_history(body: str) -> str:
    """Return the key of a body's remembered poses (nav_msgs/Path), an answer to a query of `Topics.history`."""
    return f"truth/{_part_of_a_key(body)}/history"


def truth_body(key: str) -> str | None:
    """Return the body of a key of `truth` or `truth_history`, None for a key that those would not give."""
    found = _TRUTH_KEY.match(key)
    return None if found is None else found[1]


def _part_of_a_key(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_]", "_", name)[:_LONGEST_BODY] or "body"


@dataclass(frozen=True)
class Topics:
    """Keys and frame names of the device `namespace`; raises ConfigError for a name that no ROS topic can have.

    Frames are `map`, `odom` and `cam0_color_optical_frame` of the default device; of another one all are below its
    namespace, as in `cam1/map`: devices share the key `tf`, and each has a tree of its own there.
    """

    namespace: str = _DEFAULT

    def __post_init__(self) -> None:
        if not _NAME.match(self.namespace):
            raise ConfigError(f"namespace {self.namespace!r}: give letters, digits, underscores and inner slashes only")

    @property
    def color(self) -> str:
        """sensor_msgs/Image, rgb8."""
        return f"{self.namespace}/color/image_raw"

    @property
    def color_compressed(self) -> str:
        """sensor_msgs/CompressedImage, jpeg or png."""
        return f"{self.namespace}/color/image_raw/compressed"

    @property
    def depth(self) -> str:
        """sensor_msgs/Image, 16UC1 millimetres, registered to colour."""
        return f"{self.namespace}/depth/image_raw"

    @property
    def depth_compressed(self) -> str:
        """sensor_msgs/CompressedImage, compressedDepth png or RVL."""
        return f"{self.namespace}/depth/image_raw/compressedDepth"

    @property
    def camera_info(self) -> str:
        """sensor_msgs/CameraInfo of the colour image, repeated every second for late joiners."""
        return f"{self.namespace}/color/camera_info"

    @property
    def device(self) -> str:
        """diagnostic_msgs/DiagnosticArray of a live sensor, every second: name, serial number, what it lost."""
        return f"{self.namespace}/device"

    @property
    def odom(self) -> str:
        """nav_msgs/Odometry: the causal pose with covariance, every frame."""
        return f"{self.namespace}/odom"

    @property
    def pose(self) -> str:
        """geometry_msgs/PoseStamped in `map`."""
        return f"{self.namespace}/pose"

    @property
    def path(self) -> str:
        """nav_msgs/Path: the corrected key-frame trajectory, on change."""
        return f"{self.namespace}/path"

    @property
    def status(self) -> str:
        """diagnostic_msgs/DiagnosticArray: state, reason, rates, latencies, losses."""
        return f"{self.namespace}/status"

    @property
    def loops(self) -> str:
        """diagnostic_msgs/DiagnosticArray: one message a loop candidate."""
        return f"{self.namespace}/loops"

    @property
    def features(self) -> str:
        """sensor_msgs/PointCloud2 (u, v, residual_sigma): tracked features of the frame, for eyes."""
        return f"{self.namespace}/features"

    @property
    def landmarks(self) -> str:
        """sensor_msgs/PointCloud2 (x, y, z in `map`): sparse map, for eyes."""
        return f"{self.namespace}/landmarks"

    @property
    def keyframes(self) -> str:
        """sensor_msgs/PointCloud2 (x, y, z, rgb in the camera's frame): what a key frame saw, thinned, for eyes."""
        return f"{self.namespace}/keyframes"

    @property
    def history(self) -> str:
        """Query of who joins late: answered by the messages that say what happened before."""
        return f"{self.namespace}/history"

    @property
    def odom_history(self) -> str:
        """nav_msgs/Path: the causal poses of before, thinned; an answer to a query of `history`."""
        return f"{self.history}/odom"

    @property
    def alive(self) -> str:
        """Liveliness token of the device's sensor process."""
        return f"{self.namespace}/alive"

    def alive_of(self, role: str) -> str:
        """Return the liveliness token of another process of this device (`odometry`, `recorder`, `viewer`)."""
        return f"{self.namespace}/alive/{role}"

    @property
    def ack(self) -> str:
        """Prefix below which consumers acknowledge what they have consumed (see `odom.wire.flow`)."""
        return f"{self.namespace}/ack"

    def ack_of(self, consumer: str) -> str:
        """Return the key on which `consumer` acknowledges; its liveliness token has the same name."""
        return f"{self.ack}/{consumer}"

    @property
    def end(self) -> str:
        """std_msgs/String: the source has ended, with the reason; in order behind the last message."""
        return f"{self.namespace}/end"

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
