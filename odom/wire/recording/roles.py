"""Which of a recording's topics are colour, depth and calibration, whatever they are called."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from odom.errors import ConfigError, RecordingError, WireError
from odom.frame import Camera
from odom.wire.codec import cdr, decode_camera_info, decode_color, decode_depth
from odom.wire.recording.reader import Stream

ROLES = ("color", "depth", "camera_info")

_DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")
_COLOR_WORDS, _OTHER_WORDS = ("color", "colour", "rgb"), ("ir", "infra", "depth", "thermal", "mask", "fisheye")
_REGISTERED_WORDS = ("aligned", "registered", "depth_to_color", "depth_to_rgb", "depth_to_colour")


@dataclass(frozen=True)
class Roles:
    """The topics that are colour, depth and calibration; `rectified` when colour has been undistorted."""

    color: Stream
    depth: Stream
    camera_info: Stream | None
    rectified: bool

    def camera(self) -> Camera | None:
        """Return the camera that the calibration tells, None without one.

        Raises RecordingError when its lens model is not supported, a value is malformed or its size is not colour's.
        """
        if self.camera_info is None:
            return None
        try:
            camera = decode_camera_info(self.camera_info.first, self.rectified)
        except WireError as error:
            raise RecordingError(f"no usable calibration: {error}; or give --camera camera.yaml") from error
        height, width = _size(self.color, decode_color)
        if (camera.height, camera.width) != (height, width):
            raise RecordingError(
                f"camera_info /{self.camera_info.topic} is of {camera.width} x {camera.height} pixels and colour "
                f"/{self.color.topic} of {width} x {height}: name another topic or give --camera camera.yaml"
            )
        return camera


def is_depth(stream: Stream) -> bool:
    """Whether the stream holds depth images, judged by its first message."""
    return _image_kind(stream) == "depth"


def is_color(stream: Stream) -> bool:
    """Whether the stream holds colour or grey images, judged by its first message."""
    return _image_kind(stream) == "color"


def assign_roles(streams: Sequence[Stream], named: Mapping[str, str], need_calibration: bool = True) -> Roles:
    """Choose the streams; `named` (role to topic) settles what the types leave open.

    Among several, colour prefers names that say so, depth the one registered to colour, and both the one with the
    most messages. Raises ConfigError for a name that is not there, RecordingError when a stream is missing, when the
    calibration cannot be used, or when depth has another size than colour and so cannot be registered to it.
    """
    unknown = set(named) - set(ROLES)
    if unknown:
        raise ConfigError(f"--topic {', '.join(sorted(unknown))}: give {', '.join(ROLES)}")
    color = _choose("color", streams, named, is_color, _color_rank)
    depth = _choose("depth", streams, named, is_depth, _depth_rank)
    if color is None or depth is None:
        missing = "colour" if color is None else "depth"
        raise RecordingError(f"no {missing} images; the recording holds {_listing(streams)}; name a topic with --topic")
    color_size, depth_size = _size(color, decode_color), _size(depth, decode_depth)
    if color_size != depth_size:
        raise RecordingError(
            f"depth /{depth.topic} is {depth_size[1]} x {depth_size[0]} and colour /{color.topic} is "
            f"{color_size[1]} x {color_size[0]}: depth must be registered to colour; record a registered "
            "topic, or name one with --topic depth=/name"
        )

    def rank(stream: Stream) -> tuple[int, ...]:
        return _info_rank(stream, color)

    def fits(stream: Stream) -> bool:
        return stream.type_name == cdr.CAMERA_INFO and _info_size(stream) in (color_size, None)

    info = _choose("camera_info", streams, named, fits, rank)
    if info is None and need_calibration:
        raise RecordingError(
            f"no camera_info of {color_size[1]} x {color_size[0]} pixels; the recording holds {_listing(streams)}: "
            "give --camera camera.yaml"
        )
    roles = Roles(color, depth, info, "image_rect" in color.topic)
    if info is not None and need_calibration:
        roles.camera()
    return roles


def _choose(
    role: str,
    streams: Iterable[Stream],
    named: Mapping[str, str],
    fits: Callable[[Stream], bool],
    rank: Callable[[Stream], tuple[int, ...]],
) -> Stream | None:
    if role in named:
        wanted = named[role].removeprefix("/")
        for stream in streams:
            if stream.topic == wanted:
                return stream
        raise ConfigError(f"--topic {role}={named[role]}: not in the recording, which holds {_listing(streams)}")
    return max((stream for stream in streams if fits(stream)), key=rank, default=None)


def _image_kind(stream: Stream) -> str | None:
    try:
        if stream.type_name == cdr.IMAGE:
            encoding = cdr.deserialise(stream.first, cdr.IMAGE).encoding
            return "depth" if encoding in _DEPTH_ENCODINGS else "color"
        if stream.type_name == cdr.COMPRESSED_IMAGE:
            image_format = cdr.deserialise(stream.first, cdr.COMPRESSED_IMAGE).format
            deep = "compresseddepth" in image_format.lower() or image_format.split(";")[0] in _DEPTH_ENCODINGS
            return "depth" if deep else "color"
    except WireError:
        return None
    return None


def _words(topic: str) -> set[str]:
    return set(topic.lower().replace("/", "_").split("_"))


def _color_rank(stream: Stream) -> tuple[int, ...]:
    words = _words(stream.topic)
    says_color = any(word in words for word in _COLOR_WORDS)
    says_other = any(word in words or word + "1" in words or word + "2" in words for word in _OTHER_WORDS)
    return (says_color - says_other, stream.count, stream.type_name == cdr.IMAGE)


def _depth_rank(stream: Stream) -> tuple[int, ...]:
    name = stream.topic.lower()
    return (any(word in name for word in _REGISTERED_WORDS), stream.count, stream.type_name == cdr.IMAGE)


def _info_rank(stream: Stream, color: Stream) -> tuple[int, ...]:
    own, other = stream.topic.split("/")[:-1], color.topic.split("/")
    shared = 0
    while shared < min(len(own), len(other)) and own[shared] == other[shared]:
        shared += 1
    return (shared - len(own) if shared < len(own) else 1, shared, *_color_rank(stream))


def _info_size(stream: Stream) -> tuple[int, int] | None:
    try:
        camera = decode_camera_info(stream.first)
    except WireError:
        return None
    return camera.height, camera.width


def _size(stream: Stream, decode: Callable[..., object]) -> tuple[int, int]:
    try:
        image = decode(stream.first)
    except WireError as error:
        raise RecordingError(f"/{stream.topic} cannot be decoded: {error}") from error
    shape = getattr(image, "shape", (0, 0))
    return int(shape[0]), int(shape[1])


def _listing(streams: Iterable[Stream]) -> str:
    return ", ".join(f"/{stream.topic} ({stream.type_name})" for stream in streams) or "no ROS 2 messages"
