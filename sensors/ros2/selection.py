"""Which topics of a driver are colour, depth and calibration, and how depth gets into colour's view."""

from collections.abc import Mapping
from dataclasses import dataclass

from odom.errors import RecordingError
from odom.frame import Camera
from odom.wire import Message
from odom.wire.recording import RecordedStream, SelectedStreams, select_streams
from sensors.depth_registration import DepthRegistration
from sensors.static_transforms import StaticTransforms
from sensors.stream_registration import is_registered, registration_of


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
    given: DepthRegistration | None,
    transforms: StaticTransforms,
) -> CameraTopics:
    """Choose by the first messages of some topics.

    `named`, `camera` and the registration of depth that is `given` are what the user said.
    Raises RecordingError while something is missing, ConfigError for names that are not there.
    """
    streams = [RecordedStream(m.topic, m.type_name, m, m.stamp, m.stamp, 1) for m in map(_plain, first.values())]
    chosen = select_streams(streams, named, camera is None)
    color_camera = camera or chosen.camera()
    if color_camera is None:
        raise RecordingError("no camera_info of colour")
    if is_registered(chosen):
        return CameraTopics(chosen, None)
    return CameraTopics(chosen, given or registration_of(chosen, streams, color_camera, transforms))


def _plain(message: Message) -> Message:
    return Message(message.topic.removeprefix("/"), message.type_name, message.stamp, message.payload)
