"""How depth that a driver has not registered to colour gets into colour's view: by the frames that it names."""

from collections.abc import Iterable
from itertools import takewhile

from odom.errors import ConfigError, RecordingError, WireError
from odom.frame import Camera
from odom.wire import Message
from odom.wire.codec import cdr, decode_camera_info, decode_depth
from odom.wire.recording import RecordedStream, SelectedStreams
from odom.wire.recording.stream_selection import REGISTERED_WORDS
from sensors.depth_registration import DepthRegistration
from sensors.static_transforms import StaticTransforms


def is_registered(chosen: SelectedStreams) -> bool:
    """Return whether depth is in colour's view already: of its size, and by its frame or its name."""
    depth = chosen.depth
    return chosen.has_depth_in_colors_size() and (
        frame_of(depth.first) == frame_of(chosen.color.first)
        or any(word in depth.topic.lower() for word in REGISTERED_WORDS)
    )


def registration_of(
    chosen: SelectedStreams, streams: Iterable[RecordedStream], color_camera: Camera, transforms: StaticTransforms
) -> DepthRegistration:
    """Return what brings depth into colour's view: its camera_info, and the transform between the two frames.

    Raises RecordingError when one is missing or cannot be used.
    """
    depth, size = chosen.depth, decode_depth(chosen.depth.first).shape[::-1]
    depth_frame, color_frame = frame_of(depth.first), frame_of(chosen.color.first)
    infos = [s for s in streams if s.type_name == cdr.CAMERA_INFO and _info_size(s.first) == size]
    info = max(infos, key=lambda s: (_shared(s.topic, depth.topic), frame_of(s.first) == depth_frame), default=None)
    if info is None:
        raise RecordingError(
            f"depth /{depth.topic} ({size[0]} x {size[1]}, in {depth_frame}) is not registered to colour, and no "
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


def frame_of(message: Message) -> str:
    """Return the frame that a message's header names; raises WireError on malformed bytes."""
    return str(cdr.deserialise(message, message.type_name).header.frame_id).removeprefix("/")


def _info_size(info: Message) -> tuple[int, int] | None:
    try:
        camera = decode_camera_info(info)
    except WireError:
        return None
    return camera.width, camera.height


def _shared(topic: str, other: str) -> int:
    """Return how many parts of two topics are the same from the beginning on."""
    pairs = zip(topic.split("/"), other.split("/"), strict=False)
    return len(list(takewhile(lambda pair: pair[0] == pair[1], pairs)))
