"""Which of a recording's topics are colour, depth and calibration, whatever they are called."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from numpy.typing import NDArray

from odom.errors import ConfigError, RecordingError, WireError
from odom.frame import Camera
from odom.wire.codec import cdr, decode_camera_info, decode_color, decode_depth
from odom.wire.message import Message
from odom.wire.recording.image_kind import frame_of, image_kind
from odom.wire.recording.reader import RecordedStream
from odom.wire.recording.topic_words import (
    says_color,
    says_depth,
    says_other,
    says_rectified,
    says_registered,
    shared_folders,
)

STREAM_ROLES = ("color", "depth", "camera_info")

_MOST_APART = 0.05
"""Share of colour's width by which pixels of depth's own calibration may lie beside colour's: 32 of 640. A driver
that registers a Kinect's depth may still give its 570 px beside colour's 525, which is 25; two cameras of a RealSense
lie 100 and more apart. Chosen by hand."""


@dataclass(frozen=True)
class SelectedStreams:
    """Topics of colour, depth and calibration, the images' sizes (height, width), and whether colour is `rectified`."""

    color: RecordedStream
    depth: RecordedStream
    camera_info: RecordedStream | None
    rectified: bool
    color_size: tuple[int, int]
    depth_size: tuple[int, int]

    def camera(self) -> Camera | None:
        """Return the recorded calibration, None without one.

        Raises RecordingError when its lens model is not supported, a value is malformed or its size is not colour's.
        """
        if self.camera_info is None:
            return None
        try:
            camera = decode_camera_info(self.camera_info.first, self.rectified)
        except WireError as error:
            raise RecordingError(f"no usable calibration: {error}; or give --camera camera.yaml") from error
        height, width = self.color_size
        if (camera.height, camera.width) != (height, width):
            raise RecordingError(
                f"camera_info /{self.camera_info.topic} is of {camera.width} x {camera.height} pixels and colour "
                f"/{self.color.topic} of {width} x {height}: name another topic or give --camera camera.yaml"
            )
        return camera


def unregistered(selected: SelectedStreams, streams: Iterable[RecordedStream], color_camera: Camera) -> str | None:
    """Return in words why depth is hardly registered to colour, None where nothing speaks against it.

    Its driver then publishes a calibration of depth's own beside it, by which the same pixel looks elsewhere.
    """
    depth, color = selected.depth, selected.color
    if says_registered(depth.topic):
        return None
    for stream in streams:
        is_depths = shared_folders(stream.topic, depth.topic) > shared_folders(stream.topic, color.topic)
        if stream.type_name != cdr.CAMERA_INFO or not is_depths:
            continue
        try:
            camera = decode_camera_info(stream.first)
        except WireError:
            continue
        off_px = _apart_px(camera, color_camera)
        if off_px > _MOST_APART * color_camera.width:
            return (
                f"depth /{depth.topic} has a calibration of its own, /{stream.topic}, by which its pixels lie up to "
                f"{off_px:.0f} px beside colour's: if it is not registered to colour, poses are wrong; record or name "
                "(--topic depth=/NAME) depth that is, such as aligned_depth_to_color or depth_registered; odom doctor "
                "measures whether it is"
            )
    return None


def of_another_camera(selected: SelectedStreams) -> str | None:
    """Return in words why the calibration is hardly colour's, None where nothing speaks against it."""
    info, color = selected.camera_info, selected.color
    if info is None or not says_other(info.topic) or says_other(color.topic) or says_registered(info.topic):
        return None
    return (
        f"calibration /{info.topic} is by its name not that of colour /{color.topic}: if it is another camera's, poses "
        "are wrong; record colour's camera_info too, or give --camera camera.yaml"
    )


def _apart_px(one: Camera, other: Camera) -> float:
    """Return by how many pixels of the other camera the two differ at most, along the borders of the image."""
    sides = ((one.fx, one.cx, other.fx, other.cx, other.width), (one.fy, one.cy, other.fy, other.cy, other.height))
    return max(abs((edge - c) / f * f_other + c_other - edge) for f, c, f_other, c_other, n in sides for edge in (0, n))


def select_streams(
    streams: Sequence[RecordedStream],
    named: Mapping[str, str],
    need_calibration: bool = True,
) -> SelectedStreams:
    """Choose the streams; `named` (role to topic) decides where the types leave a choice.

    Among several, both prefer names that say so, then those of one device, whose topics share most folders, then depth
    registered to colour by its name, then in colour's frame, then the most messages. Raises ConfigError for a name that
    is not there, RecordingError when a stream is missing, an image cannot be decoded or the calibration cannot be used.
    """
    unknown = set(named) - set(STREAM_ROLES)
    if unknown:
        raise ConfigError(f"--topic {', '.join(sorted(unknown))}: give {', '.join(STREAM_ROLES)}")
    colors, depths = (_named(role, streams, named) or _images(role, streams) for role in ("color", "depth"))
    if not colors or not depths:
        missing = "depth" if colors else "colour"
        raise RecordingError(f"no {missing} images; the recording holds {_listing(streams)}; name a topic with --topic")
    color, depth = max(product(colors, depths), key=lambda pair: _rank(*pair))
    size, depth_size = _size(color, decode_color), _size(depth, decode_depth)

    def fits(stream: RecordedStream) -> bool:
        return stream.type_name == cdr.CAMERA_INFO and info_size(stream) in (size, None)

    infos = _named("camera_info", streams, named) or [stream for stream in streams if fits(stream)]
    info = max(infos, key=lambda stream: _info_rank(stream, color), default=None)
    if info is None and need_calibration:
        raise RecordingError(
            f"no camera_info of {size[1]} x {size[0]} pixels; the recording holds {_listing(streams)}: "
            "give --camera camera.yaml"
        )
    selected = SelectedStreams(color, depth, info, says_rectified(color.topic), size, depth_size)
    if info is not None and need_calibration:
        selected.camera()
    return selected


def _named(role: str, streams: Iterable[RecordedStream], named: Mapping[str, str]) -> list[RecordedStream]:
    """Return the stream that is named for a role, none where none is named; raises ConfigError for an unknown one."""
    if role not in named:
        return []
    found = [stream for stream in streams if stream.topic == named[role].removeprefix("/")]
    if not found:
        raise ConfigError(f"--topic {role}={named[role]}: not in the recording, which holds {_listing(streams)}")
    return found[:1]


def _images(role: str, streams: Iterable[RecordedStream]) -> list[RecordedStream]:
    return [stream for stream in streams if image_kind(stream.first) == role]


def _rank(color: RecordedStream, depth: RecordedStream) -> tuple[int, ...]:
    """Rank colour and depth: by what their names say, as images of one device, registered, and by their number."""
    return (
        says_color(color.topic),
        says_depth(depth.topic),
        shared_folders(depth.topic, color.topic),
        says_registered(depth.topic),
        frame_of(color.first) == frame_of(depth.first),
        color.count,
        depth.count,
        color.type_name == cdr.IMAGE,
        depth.type_name == cdr.IMAGE,
    )


def _info_rank(stream: RecordedStream, color: RecordedStream) -> tuple[int, ...]:
    """Rank a calibration by how much of its path is colour's: one in the same folder or above comes first."""
    own, shared = stream.topic.count("/"), shared_folders(stream.topic, color.topic)
    return (shared - own if shared < own else 1, shared, says_color(stream.topic), stream.count)


def info_size(stream: RecordedStream) -> tuple[int, int] | None:
    """Return height and width of the camera that a stream's first message is the calibration of, None if it is none."""
    try:
        camera = decode_camera_info(stream.first)
    except WireError:
        return None
    return camera.height, camera.width


def _size(stream: RecordedStream, decode: Callable[[Message], NDArray[Any]]) -> tuple[int, int]:
    """Return height and width of a stream's first image."""
    try:
        height, width = decode(stream.first).shape[:2]
    except WireError as error:
        raise RecordingError(f"/{stream.topic} cannot be decoded: {error}") from error
    return height, width


def _listing(streams: Iterable[RecordedStream]) -> str:
    return ", ".join(f"/{stream.topic} ({stream.type_name})" for stream in streams) or "no ROS 2 messages"
