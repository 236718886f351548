"""How depth that a driver has not registered to colour gets into colour's view: by the frames that it names."""

from collections.abc import Iterable

from odom.errors import ConfigError, RecordingError, WireError
from odom.frame import Camera
from odom.wire.codec import cdr, decode_camera_info
from odom.wire.recording import RecordedStream, SelectedStreams
from odom.wire.recording.image_kind import frame_of
from odom.wire.recording.stream_selection import info_size
from odom.wire.recording.topic_words import says_registered, shared_folders
from sensors.depth_registration import DepthRegistration
from sensors.static_transforms import StaticTransforms


def is_registered(chosen: SelectedStreams) -> bool:
    """Return whether depth is in colour's view already: of its size, and by its frame or its name."""
    depth, color = chosen.depth, chosen.color
    return chosen.depth_size == chosen.color_size and (
        frame_of(depth.first) == frame_of(color.first) or says_registered(depth.topic)
    )


def registration_of(
    chosen: SelectedStreams, streams: Iterable[RecordedStream], color_camera: Camera, transforms: StaticTransforms
) -> DepthRegistration:
    """Return what brings depth into colour's view: its camera_info, and the transform between the two frames.

    Raises RecordingError when one is missing or cannot be used.
    """
    depth, (height, width) = chosen.depth, chosen.depth_size
    depth_frame, color_frame = frame_of(depth.first), frame_of(chosen.color.first)
    infos = [s for s in streams if s.type_name == cdr.CAMERA_INFO and info_size(s) == chosen.depth_size]
    info = max(
        infos, key=lambda s: (shared_folders(s.topic, depth.topic), frame_of(s.first) == depth_frame), default=None
    )
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
