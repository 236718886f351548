"""Finds a driver's topics: listens to all possible image topics until colour, depth and calibration have come.

The messages it looks at stay in the inbox: the source begins with the first images.
"""

import logging
import time
from dataclasses import dataclass, field

from odom.errors import ConfigError, RecordingError, SourceError, WireError
from odom.frame import Camera
from odom.wire import Message
from odom.wire.codec import decode_tf
from odom.wire.recording.image_kind import can_be_decoded
from odom.wire.ros2.graph import RosGraph, several, strange_type
from odom.wire.ros2.inbox import Inbox
from odom.wire.ros2.names import Endpoint
from odom.wire.ros2.static_frames import TF_STATIC
from sensors.depth_registration import DepthRegistration
from sensors.ros2.image_topics import image_topics, info_topics
from sensors.ros2.selection import CameraTopics, camera_topics
from sensors.ros2.settings import Ros2Settings
from sensors.static_transforms import StaticTransforms

_LOG = logging.getLogger(__name__)
_SETTLING_S = 1.0
"""Seconds after the first message in which better topics than the first may come (depth registered to colour), unless
all topics were there and sending for so long: a recording that waits to be played. Shorter: a driver that is starting
is taken for one that has no such topic; longer: the first image comes later."""
_MOST_TOPICS = 24
"""Images and calibrations that are listened to while searching; a driver of several cameras has some twenty."""
_POLL_S = 0.05
"""Seconds between two looks at the graph and at what has come. Chosen by hand."""
_TF_STATIC = f"/{TF_STATIC}"


@dataclass
class Search:
    """What has been found below `prefix` so far.

    `named` (role to topic), `camera` and the `registration` of depth are what the user said.
    `_joined` and `_spoke` are when the last topic was joined, and when the first message came (monotonic seconds);
    `_wanted` are the topics to choose among: none of an image that has appeared in a better form since. `_whole` are
    those of which a message that can be decoded has come.
    """

    graph: RosGraph
    inbox: Inbox
    prefix: str
    settings: Ros2Settings
    named: dict[str, str]
    camera: Camera | None
    registration: DepthRegistration | None
    first: dict[str, Message] = field(default_factory=dict)
    transforms: StaticTransforms = field(default_factory=StaticTransforms)
    _joined: float = 0.0
    _spoke: float = 0.0
    _wanted: tuple[str, ...] = ()
    _whole: set[str] = field(default_factory=set)

    def run(self) -> CameraTopics:
        """Return the topics once they are clear, and listen to no others; raises SourceError with what is missing."""
        begun = time.monotonic()
        missing = "nothing has come yet"
        while time.monotonic() < begun + self.settings.start_s:
            self._listen()
            time.sleep(_POLL_S)
            self._look()
            if not self._is_settled():
                continue
            try:
                first = {topic: message for topic, message in self.first.items() if topic in self._wanted}
                found = camera_topics(first, self.named, self.camera, self.registration, self.transforms)
            except (RecordingError, WireError) as error:
                missing = str(error)
                continue
            self._leave_others(found)
            return found
        raise SourceError(self._what_is_missing(missing))

    def _is_settled(self) -> bool:
        now = time.monotonic()
        all_speak = self.first.keys() >= set(self.inbox.topics) - {_TF_STATIC}
        return bool(self.first) and now >= _SETTLING_S + (self._joined if all_speak else self._spoke)

    def _listen(self) -> None:
        topics = self.graph.endpoints(self.prefix)
        named = {topic: ends for topic, ends in self.graph.endpoints().items() if topic in self._named}
        images = image_topics(topics, self.settings.transport == "compressed")
        self._wanted = (*named, *images, *info_topics(topics))
        everything = topics | named | {_TF_STATIC: self.graph.endpoints().get(_TF_STATIC, [])}
        for topic in (_TF_STATIC, *self._wanted[:_MOST_TOPICS]):
            if everything[topic] and topic not in self.inbox.topics:
                self.inbox.subscribe(_known(everything[topic]))
                self._joined = time.monotonic()

    @property
    def _named(self) -> set[str]:
        return {"/" + topic.removeprefix("/") for topic in self.named.values()}

    def _look(self) -> None:
        if not self.first:
            self._spoke = time.monotonic()
        for message in self.inbox.waiting():
            if message.topic != _TF_STATIC:
                self._keep(message)
                continue
            try:
                self.transforms.take(decode_tf(message))
            except WireError as error:
                _LOG.debug("%s: %s", _TF_STATIC, error)

    def _keep(self, message: Message) -> None:
        """Keep the first message of a topic that can be decoded, until it comes the first."""
        if message.topic not in self._whole and can_be_decoded(message):
            self._whole.add(message.topic)
            self.first[message.topic] = message
        self.first.setdefault(message.topic, message)

    def _leave_others(self, found: CameraTopics) -> None:
        streams = (found.streams.color, found.streams.depth, found.streams.camera_info)
        kept = {f"/{stream.topic}" for stream in streams if stream is not None}
        for topic in set(self.inbox.topics) - kept:
            self.inbox.unsubscribe(topic)
        for topic, publishers in self.graph.endpoints().items():
            if topic in kept and len(publishers) > 1:
                _LOG.warning("%s", several(topic, [each.node.full_name for each in publishers]))

    def _what_is_missing(self, missing: str) -> str:
        topics = self.graph.endpoints(self.prefix)
        heard, domain, waited = self.inbox.topics, self.settings.domain, self.settings.start_s
        if not self.graph.endpoints():
            return (
                f"no ROS 2 publisher is seen in domain {domain} by the router {self.settings.router} within "
                f"{waited:g} s: is rmw_zenohd (or odom router, or odom ros2) running, and ROS_DOMAIN_ID the same?"
            )
        if not image_topics(topics, compressed=False) and not self._named:
            others = ", ".join(sorted(image_topics(self.graph.endpoints(), compressed=False))[:10]) or "no images"
            return f"no images below {self.prefix} in domain {domain}; published are: {others}"
        silent = sorted(topic for topic in heard if topic not in self.first and topic != _TF_STATIC)
        if not self.first:
            return f"no message within {waited:g} s on {', '.join(silent)}, though they are published"
        if missing.startswith("no camera_info"):
            infos = sorted(topic for topic in silent if topic in info_topics(topics))
            why = f"nothing comes on {', '.join(infos)}" if infos else f"none is published below {self.prefix}"
            advice = "give --camera camera.yaml, or name the topic: --topic camera_info=/name"
            return f"no camera_info for {waited:g} s: {why}: {advice}"
        return missing.replace("the recording holds", "published are")


def _known(publishers: list[Endpoint]) -> Endpoint:
    """Return the first publisher; raises ConfigError when it defines the type of its messages otherwise."""
    first = publishers[0]
    if told := strange_type(first.topic, first.node.full_name, first.type_name, first.type_hash):
        raise ConfigError(told)
    return first
