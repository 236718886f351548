"""A camera of ROS 2 as a live source: the bytes of its images as they come, on the keys of this device."""

import logging
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

from odom.errors import ConfigError, OdomError, WireError
from odom.wire import Message, WireSettings
from odom.wire.codec import cdr, decode_camera_info, decode_depth, encode_calibration, encode_camera_info
from odom.wire.ros2.graph import RosGraph, several
from odom.wire.ros2.inbox import Inbox
from odom.wire.ros2.names import NodeName
from odom.wire.ros2.node import Ros2Node, ros2_wire
from odom.wire.session import open_session
from sensors.calibration_file import load_calibration
from sensors.depth_registration import load_depth_registration
from sensors.encoder import ImageEncoder
from sensors.ros2.catching_up import AT_START, CatchingUp
from sensors.ros2.search import Search
from sensors.ros2.settings import Ros2Settings
from sensors.source import SourceOptions

_LOG = logging.getLogger(__name__)
_POLL_S = 0.2
"""Longest wait for a message, in seconds, before silence and the end are checked. Chosen by hand."""
_NODE = "odom_source"


class Ros2Source:
    """Colour, depth and calibration of a driver; what the consumer is too slow for is dropped and counted.

    Depth that the driver has not registered to colour is registered here. Raises SourceError when the topics cannot be
    found, ConfigError when they cannot be used (see `Search`); later failures are logged, and it waits for the driver
    to come back.
    """

    lossless = False
    length: int | None = None

    def __init__(self, prefix: str, settings: Ros2Settings, options: SourceOptions) -> None:
        self._settings, self._options = settings, options
        self._stack = ExitStack()
        self._closed = False
        camera = registration = None
        if options.camera is not None:
            camera = load_calibration(options.camera).camera
            registration = load_depth_registration(options.camera, camera)
        wire = WireSettings(ros2_domain=settings.domain, ros2_router=settings.router)
        try:
            session = self._stack.enter_context(open_session(ros2_wire(wire)))
            name = NodeName(settings.domain, str(session.zenoh.info.zid()), 0, "/", _NODE)
            node = Ros2Node(session.zenoh, name)
            session.at_close(node.close)
            self._graph = RosGraph(session, settings.domain)
            self._inbox = Inbox(node, AT_START)
            session.at_close(self._inbox.close)
            named = dict(options.topics_from)
            search = Search(self._graph, self._inbox, prefix, settings, named, camera, registration)
            self._topics = search.run()
        except OdomError:
            self._stack.close()
            raise
        self._images = ImageEncoder(options)
        chosen = self._topics.streams
        self._color, self._depth = f"/{chosen.color.topic}", f"/{chosen.depth.topic}"
        self._info = None if camera is not None or chosen.camera_info is None else f"/{chosen.camera_info.topic}"
        self._camera = camera
        registered = "by its driver" if self._topics.registration is None else "here"
        _LOG.info("colour %s, depth %s registered %s", self._color, self._depth, registered)

    @property
    def counters(self) -> dict[str, int]:
        """Messages received, lost on the way, dropped since newer ones came, and malformed."""
        return {name: self._inbox.counts[name] for name in ("received", "lost", "dropped", "malformed")}

    def messages(self) -> Iterator[Message]:
        """Yield calibration, colour and depth as they come, until `close`, `--seconds` or `end_s` without an image."""
        begun = heard = time.monotonic()
        is_silent = False
        arrivals = CatchingUp(self._inbox, self._settings.waiting)
        if early := self._inbox.counts["dropped"]:
            _LOG.info("%d messages came before they could be taken, and were dropped for newer ones", early)
        yield from self._calibration()
        while not self._closed:
            message = arrivals.receive(_POLL_S)
            now = time.monotonic()
            if self._options.seconds is not None and now - begun >= self._options.seconds:
                return
            if message is not None and message.topic in (self._color, self._depth):
                heard = now
                if is_silent:
                    _LOG.info("images come again on %s and %s", self._color, self._depth)
                is_silent = False
            elif self._settings.end_s and now - heard >= self._settings.end_s:
                return
            elif now - heard >= self._settings.silence_s and not is_silent:
                is_silent = True
                _LOG.warning("%s", self._why_silent())
            if message is not None and (translated := self._translated(message)) is not None:
                yield translated

    def close(self) -> None:
        """Leave ROS 2 and end `messages`; safe to call twice."""
        if not self._closed:
            self._closed = True
            self._stack.close()
            counts = ", ".join(f"{count} {name}" for name, count in self.counters.items())
            _LOG.info("%s and %s: %s", self._color, self._depth, counts)

    def _calibration(self) -> tuple[Message, ...]:
        """Return the calibration of the images as they are: a rectified image has the new matrix, no distortion."""
        chosen, topics = self._topics.streams, self._options.topics
        camera = self._camera or chosen.camera()
        if camera is None:
            raise ConfigError("no calibration of colour: give --camera camera.yaml")
        return encode_calibration(
            (topics.camera_info, topics.depth_info), chosen.color.begin, camera, topics.frame_camera
        )

    def _translated(self, message: Message) -> Message | None:
        topics = self._options.topics
        is_raw = message.type_name == cdr.IMAGE
        try:
            if message.topic == self._color:
                return replace(message, topic=topics.color if is_raw else topics.color_compressed)
            if message.topic == self._depth:
                if self._topics.registration is not None:
                    return self._images.depth(message.stamp, self._topics.registration(decode_depth(message)))
                return replace(message, topic=topics.depth if is_raw else topics.depth_compressed)
            if message.topic == self._info:
                camera = decode_camera_info(message, self._topics.streams.rectified)
                return encode_camera_info(topics.camera_info, message.stamp, camera, topics.frame_camera)
        except (ConfigError, WireError) as error:
            self._inbox.counts["malformed"] += 1
            _LOG.debug("%s: %s", message.topic, error)
        return None

    def _why_silent(self) -> str:
        publishers = self._graph.endpoints()
        gone = [topic for topic in (self._color, self._depth) if topic not in publishers]
        for topic, ends in publishers.items():
            if topic in (self._color, self._depth) and len(ends) > 1:
                return several(topic, [each.node.full_name for each in ends])
        why = f"nobody publishes {' and '.join(gone)} any more" if gone else "their publishers live"
        return f"no image for {self._settings.silence_s:g} s on {self._color} and {self._depth}: {why}"
