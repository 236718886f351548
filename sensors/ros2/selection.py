"""Which topics of a driver are colour, depth and calibration, and how depth gets into colour's view."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from odom.errors import ConfigError, RecordingError, WireError
from odom.frame import Camera
from odom.wire import Message
from odom.wire.codec import cdr, decode_camera_info, decode_depth
from odom.wire.recording import RecordedStream, SelectedStreams, select_streams
from sensors.depth_registration import DepthRegistration
from sensors.ros2.static_transforms import StaticTransforms

_REGISTERED_WORDS = ("aligned", "registered", "depth_to_color", "depth_to_rgb", "depth_to_colour")
"""Words in the name of a depth topic that its driver has registered to colour."""


@dataclass(frozen=True, eq=False)
class CameraTopics:
    """Topics of colour, depth and calibration (None: given otherwise), and what brings depth into colour's view.

    `registration` is None where the driver does that.
    """

    streams: SelectedStreams
    registration: DepthRegistration | None


def camera_topics(
    first: Mapping[str, Message],
    named: Mapping[str, str],
    camera: Camera | None,
    transforms: StaticTransforms,
) -> CameraTopics:
    """Choose by the first messages of some topics; `named` and `camera` are what the user said.

    Raises RecordingError while something is missing, ConfigError for names that are not there.
    """
    streams = [RecordedStream(m.topic, m.type_name, m, m.stamp, m.stamp, 1) for m in map(_plain, first.values())]
    chosen = select_streams(streams, named, camera is None, takes_other_size=True)
    color_camera = camera or chosen.camera()
    if color_camera is None:
        raise RecordingError("no camera_info of colour")
    return CameraTopics(chosen, _registration(chosen, streams, color_camera, transforms))


def _registration(
    chosen: SelectedStreams, streams: Iterable[RecordedStream], color_camera: Camera, transforms: StaticTransforms
) -> DepthRegistration | None:
    depth, color = chosen.depth, chosen.color
    height, width = decode_depth(depth.first).shape
    fits = (width, height) == (color_camera.width, color_camera.height)
    depth_frame, color_frame = _frame(depth.first), _frame(color.first)
    if fits and (depth_frame == color_frame or any(word in depth.topic.lower() for word in _REGISTERED_WORDS)):
        return None
    infos = [s for s in streams if s.type_name == cdr.CAMERA_INFO and _size(s.first) == (width, height)]
    info = max(infos, key=lambda s: (_shared(s.topic, depth.topic), _frame(s.first) == depth_frame), default=None)
    if info is None:
        raise RecordingError(
            f"depth /{depth.topic} ({width} x {height}, in {depth_frame}) is not registered to colour, and no "
            "camera_info of its size comes: let the driver align depth to colour, or name a registered topic by "
            "--topic depth=/name"
        )
    T_color_depth = transforms.between(color_frame, depth_frame)
    if T_color_depth is None:
        raise RecordingError(
            f"depth /{depth.topic} is in {depth_frame} and colour in {color_frame}, and /tf_static does not say how "
            "they lie to each other: let the driver publish it (publish_tf), or align depth to colour"
        )
    try:
        return DepthRegistration(decode_camera_info(info.first), color_camera, T_color_depth)
    except (ConfigError, WireError) as error:
        raise RecordingError(f"depth /{depth.topic} cannot be registered to colour: {error}") from error


def _plain(message: Message) -> Message:
    return Message(message.topic.removeprefix("/"), message.type_name, message.stamp, message.payload)


def _frame(message: Message) -> str:
    return str(cdr.deserialise(message, message.type_name).header.frame_id).removeprefix("/")


def _size(info: Message) -> tuple[int, int] | None:
    try:
        camera = decode_camera_info(info)
    except WireError:
        return None
    return camera.width, camera.height


def _shared(topic: str, other: str) -> int:
    """Return how many parts of two topics are the same from the beginning on."""
    count = 0
    for mine, theirs in zip(topic.split("/"), other.split("/"), strict=False):
        if mine != theirs:
            break
        count += 1
    return count
