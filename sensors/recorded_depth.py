"""What a recording says of its depth: how it gets into colour's view, and the model of its errors."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from odom.errors import RecordingError, WireError
from odom.frame import Camera
from odom.wire import Message
from odom.wire.codec import StampedPose, cdr, decode_depth_model, decode_tf
from odom.wire.recording import RecordedStream, RecordingReader, SelectedStreams
from odom.wire.recording.topic_words import shared_folders
from sensors.depth_registration import DepthRegistration, load_depth_registration
from sensors.static_transforms import StaticTransforms
from sensors.stream_registration import is_registered, registration_of

_LOOKED_AT_IMAGES = 60
"""Colour images, two seconds of them, beside which transforms are read: those that are constant are recorded first, and
again and again where each message holds all frames. Fewer: a late one may be missed; more only delay the start."""


def recorded_registration(
    reader: RecordingReader,
    chosen: SelectedStreams,
    streams: Sequence[RecordedStream],
    color_camera: Camera,
    calibration: Path | None,
) -> DepthRegistration | None:
    """Return what brings the depth of a recording into colour's view: its `calibration` file, else the recording.

    None where depth is there already; also where it has colour's size and the recording does not say how they lie to
    each other. Raises RecordingError for depth of another size of which nothing says it.
    """
    if is_registered(chosen):
        return None
    given = None if calibration is None else load_depth_registration(calibration, color_camera)
    if given is not None:
        return given
    try:
        return registration_of(chosen, streams, color_camera, _transforms(reader, chosen.color.topic))
    except RecordingError as error:
        if chosen.depth_size == chosen.color_size:
            return None
        raise RecordingError(f"{error}; or give depth_camera and T_color_depth in --camera camera.yaml") from error


def recorded_depth_model(chosen: SelectedStreams, streams: Sequence[RecordedStream]) -> Message | None:
    """Return the message with the model of the errors of the depth that is played, None where there is none.

    It is one of the same device by its topic, which shares with depth's no fewer folders than colour's does.
    """
    depth, least = chosen.depth.topic, shared_folders(chosen.depth.topic, chosen.color.topic)
    models = [s for s in streams if shared_folders(s.topic, depth) >= least and _shows_depth_model(s)]
    found = max(models, key=lambda stream: shared_folders(stream.topic, depth), default=None)
    return None if found is None else found.first


def _shows_depth_model(stream: RecordedStream) -> bool:
    """Return whether a stream holds the model of depth's errors that `odom calibrate` finds."""
    try:
        return stream.type_name == cdr.CAMERA_INFO and decode_depth_model(stream.first) is not None
    except WireError:
        return False


def _transforms(reader: RecordingReader, color: str) -> StaticTransforms:
    """Return the frames of `/tf_static`, and of `/tf`, where bags of ROS 1 have constant ones too, what it lacks."""
    found: dict[str, list[StampedPose]] = {"tf": [], "tf_static": []}
    images = 0
    for message in reader.messages({*found, color}):
        images += message.topic == color
        if images > _LOOKED_AT_IMAGES:
            break
        with suppress(WireError):
            if message.topic in found:
                found[message.topic] += decode_tf(message)
    transforms = StaticTransforms()
    for frames in found.values():
        transforms.take(tuple(frames))
    return transforms
