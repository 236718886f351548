"""Which of a recording's topics are colour, depth and calibration, whatever they are called."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any

from numpy.typing import NDArray

from odom.errors import ConfigError, RecordingError, WireError
from odom.frame import Camera
from odom.wire.codec import cdr, decode_camera_info, decode_color, decode_depth
from odom.wire.codec.image_files import is_deep_grey_png
from odom.wire.message import Message
from odom.wire.recording.reader import RecordedStream

STREAM_ROLES = ("color", "depth", "camera_info")

_DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")
_COLOR_WORDS, _OTHER_WORDS = ("color", "colour", "rgb"), ("ir", "infra", "depth", "thermal", "mask", "fisheye")
_DEPTH_WORDS, _INFRARED_WORDS = ("depth",), ("ir", "infra", "infrared")
_NOT_DEPTH_WORDS = (*_INFRARED_WORDS, "confidence", "disparity", "thermal", "mask", "amplitude", "intensity")
_REGISTERED_WORDS = ("aligned", "registered", "depth_to_color", "depth_to_rgb", "depth_to_colour")
"""Words that drivers put into the names of topics: for colour, for what is not colour, for depth, for infrared images
(which stand in for colour), for images of 16 bits that are no depth, for depth registered to colour."""

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
    if says_registered(depth):
        return None
    for stream in streams:
        is_depths = shared_folders(stream, depth) > shared_folders(stream, color)
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
    others = _numbered(_OTHER_WORDS)
    if info is None or not _says(info, others) or _says(color, others):
        return None
    if says_registered(info):
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

    Among several, colour prefers names that say so, depth the one registered to colour, and both the one with the
    most messages. Raises ConfigError for a name that is not there, RecordingError when a stream is missing, an
    image cannot be decoded or the calibration cannot be used.
    """
    unknown = set(named) - set(STREAM_ROLES)
    if unknown:
        raise ConfigError(f"--topic {', '.join(sorted(unknown))}: give {', '.join(STREAM_ROLES)}")
    color = _choose("color", streams, named, lambda stream: _image_kind(stream) == "color", _color_rank)
    depth = _choose(
        "depth", streams, named, lambda stream: _image_kind(stream) == "depth", lambda s: _depth_rank(s, color)
    )
    if color is None or depth is None:
        missing = "colour" if color is None else "depth"
        raise RecordingError(f"no {missing} images; the recording holds {_listing(streams)}; name a topic with --topic")
    size, depth_size = _size(color, decode_color), _size(depth, decode_depth)

    def fits(stream: RecordedStream) -> bool:
        return stream.type_name == cdr.CAMERA_INFO and info_size(stream) in (size, None)

    info = _choose("camera_info", streams, named, fits, lambda stream: _info_rank(stream, color))
    if info is None and need_calibration:
        raise RecordingError(
            f"no camera_info of {size[1]} x {size[0]} pixels; the recording holds {_listing(streams)}: "
            "give --camera camera.yaml"
        )
    selected = SelectedStreams(color, depth, info, "image_rect" in color.topic, size, depth_size)
    if info is not None and need_calibration:
        selected.camera()
    return selected


def _choose(
    role: str,
    streams: Iterable[RecordedStream],
    named: Mapping[str, str],
    fits: Callable[[RecordedStream], bool],
    rank: Callable[[RecordedStream], tuple[int, ...]],
) -> RecordedStream | None:
    """Return the stream that is named for a role, else the one of highest rank among those that fit, if any."""
    if role in named:
        wanted = named[role].removeprefix("/")
        for stream in streams:
            if stream.topic == wanted:
                return stream
        raise ConfigError(f"--topic {role}={named[role]}: not in the recording, which holds {_listing(streams)}")
    return max((stream for stream in streams if fits(stream)), key=rank, default=None)


def _image_kind(stream: RecordedStream) -> str | None:
    """Return `color` or `depth` by the stream's first message, None when it is no image."""
    try:
        if stream.type_name == cdr.IMAGE:
            encoding = cdr.deserialise(stream.first, cdr.IMAGE).encoding
            is_grey = encoding == "mono16" and _is_seen(stream)
            return "depth" if encoding in _DEPTH_ENCODINGS and not is_grey else "color"
        if stream.type_name == cdr.COMPRESSED_IMAGE:
            image = cdr.deserialise(stream.first, cdr.COMPRESSED_IMAGE)
            deep = "compresseddepth" in image.format.lower() or image.format.split(";")[0] in _DEPTH_ENCODINGS
            deep |= is_deep_grey_png(image.data) and not _is_seen(stream)
            return "depth" if deep else "color"
    except WireError:
        return None
    return None


def _is_seen(stream: RecordedStream) -> bool:
    """Return whether images in 16 bits of grey are by their name not depth, but what a camera sees, infrared too."""
    return _says(stream, _COLOR_WORDS) or (
        _says(stream, _numbered(_INFRARED_WORDS)) and not _says(stream, _DEPTH_WORDS)
    )


def says_registered(stream: RecordedStream) -> bool:
    """Return whether a topic's name says that it is depth's, registered to colour."""
    return any(word in stream.topic.lower() for word in _REGISTERED_WORDS)


def _says(stream: RecordedStream, words: Iterable[str]) -> bool:
    """Return whether one of the words is a word of the topic's name."""
    return not set(stream.topic.lower().replace("/", "_").split("_")).isdisjoint(words)


def _numbered(words: Iterable[str]) -> list[str]:
    """Return the words as they are and with the numbers of a pair."""
    return [word + number for word in words for number in ("", "1", "2")]


def _color_rank(stream: RecordedStream) -> tuple[int, ...]:
    says = _says(stream, _COLOR_WORDS) - _says(stream, _numbered(_OTHER_WORDS))
    return (says, stream.count, stream.type_name == cdr.IMAGE)


def _depth_rank(stream: RecordedStream, color: RecordedStream | None) -> tuple[int, ...]:
    """Rank a depth stream: one whose name says depth, that is registered, and of colour's own camera comes first."""
    says = _says(stream, _DEPTH_WORDS) - _says(stream, _numbered(_NOT_DEPTH_WORDS))
    shared = 0 if color is None else shared_folders(stream, color)
    return (says, says_registered(stream), shared, stream.count, stream.type_name == cdr.IMAGE)


def _info_rank(stream: RecordedStream, color: RecordedStream) -> tuple[int, ...]:
    """Rank a calibration by how much of its path is colour's: one in the same folder or above comes first."""
    own, shared = stream.topic.count("/"), shared_folders(stream, color)
    return (shared - own if shared < own else 1, shared, *_color_rank(stream))


def shared_folders(stream: RecordedStream, image: RecordedStream) -> int:
    """Return how many parts of a topic's path, without its last one, are those of an image's."""
    own, other = stream.topic.split("/")[:-1], image.topic.split("/")
    return len(list(takewhile(lambda pair: pair[0] == pair[1], zip(own, other, strict=False))))


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
