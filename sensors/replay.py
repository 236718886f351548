"""A recording as a source: its colour, depth, calibration and truth, on the keys of this device, bytes unchanged."""

import logging
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from odom.errors import ConfigError, RecordingError, WireError
from odom.frame import Stamp, from_seconds
from odom.wire import Message
from odom.wire.codec import (
    cdr,
    decode_camera_info,
    decode_depth,
    encode_calibration,
    encode_camera_info,
    encode_depth,
    restamp,
)
from odom.wire.recording import (
    RecordedStream,
    RecordingReader,
    SelectedStreams,
    of_another_camera,
    open_reader,
    select_streams,
    unregistered,
)
from sensors.calibration_file import load_calibration
from sensors.recorded_depth import recorded_depth_model, recorded_registration
from sensors.recorded_truth import TRUTH_ROLE, TruthReader, could_be_truth, true_poses
from sensors.source import SourceOptions

log = logging.getLogger(__name__)

_PEEK_BYTES = 128 << 20
"""Bytes of a recording read to find its streams (4 s of raw images); those that begin later are found by the index.
Less: where there is none, as in cut recordings, one may be missed; more delays the start."""
_MOST_TOLD = 5
"""Most damages of a recording that are told, a line each; the others are only counted."""
_MOST_BEHIND = 30
"""Messages that may come after much later ones of another topic before this is told: fewer are strays."""
_MOST_LATE = 200
"""Reading stops after this many messages in a row beyond `end`: fewer may be out of order, more are read in vain."""


class ReplaySource:
    """Colour, depth, calibration and truth of a recording in the order of their stamps.

    The options' `start` and `end` are seconds from the first image whose stamp others follow; a whole recording is
    played with the truth before it too. `registration` brings depth into colour's view, None where it is there already.
    `taken` says in words which topics are played, `doubts` what speaks against depth and calibration being colour's,
    `could_be_truth` which poses could be truth where none are. `length` is the
    number of colour images, None when only a part is played or they were not counted.
    """

    lossless = True

    def __init__(
        self, reader: RecordingReader, streams: list[RecordedStream], counts: Mapping[str, int], options: SourceOptions
    ) -> None:
        topics = self._topics = options.topics
        named = dict(options.topics_from)
        truths = true_poses(streams, named.pop(TRUTH_ROLE, None))
        camera = None if options.camera is None else load_calibration(options.camera).camera
        self._roles: SelectedStreams = select_streams(streams, named, need_calibration=camera is None)
        self._reader = reader
        self._truths, self._read_truth = truths, TruthReader(truths)
        self._keys = {
            self._roles.color.topic: topics.color if _is_raw(self._roles.color) else topics.color_compressed,
            self._roles.depth.topic: topics.depth if _is_raw(self._roles.depth) else topics.depth_compressed,
        }
        images = self._roles.color, self._roles.depth
        zero = min([s.steady for s in images if s.steady is not None] or [s.begin for s in images])
        self._start = None if options.start == 0 else Stamp(zero + from_seconds(options.start))
        self._end = None if options.end is None else Stamp(zero + from_seconds(options.end))
        whole = self._start is None and self._end is None
        self.length = counts.get(self._roles.color.topic) if whole else None
        self._begin = self._start or zero
        info = self._roles.camera_info
        self._info_key = topics.camera_info
        self._info_topic = None if camera is not None or info is None else info.topic
        if camera is not None:
            keys = self._info_key, topics.depth_info
            self._calibration = encode_calibration(keys, self._begin, camera, topics.frame_camera)
        else:
            assert info is not None
            model = recorded_depth_model(self._roles, streams)
            self._calibration = (
                *(() if model is None else (replace(model, topic=topics.depth_info),)),
                self._as_calibration(info.first),
            )
        used = camera or self._roles.camera()
        assert used is not None
        self.registration = recorded_registration(reader, self._roles, streams, used, options.camera)
        doubts = (
            None if self.registration else unregistered(self._roles, streams, used),
            None if camera is not None else of_another_camera(self._roles),
        )
        self.doubts = [doubt for doubt in doubts if doubt is not None]
        calibration = f"/{self._info_topic}" if self._info_topic else str(options.camera)
        depth = f"{self._roles.depth.topic}{' (registered here)' if self.registration else ''}"
        self.taken = (
            f"colour /{self._roles.color.topic}, depth /{depth}, calibration {calibration}, truth "
            f"{', '.join(f'/{topic}' for topic in truths) or 'none'}"
        )
        self.could_be_truth = None if truths else could_be_truth(streams, self._roles.color.topic)
        self._closed = False

    def messages(self) -> Iterator[Message]:
        """Yield the calibration, then everything by stamp; log at the end what the recording lacks."""
        yield from (restamp(message, self._begin) for message in self._calibration)
        wanted = {*self._keys, *self._truths, *({self._info_topic} if self._info_topic else ())}
        for message in self._until_end(self._reader.messages(wanted, self._start)):
            if self._closed:
                return
            if message.topic == self._info_topic:
                if message.stamp > self._begin:
                    yield self._as_calibration(message)
            elif message.topic in self._truths:
                if (pose := self._read_truth(message)) is not None:
                    yield pose
            else:
                yield self._registered(replace(message, topic=self._keys[message.topic]))
        self._read_truth.tell(self._reader.path)
        if self._reader.behind > _MOST_BEHIND:
            log.warning(
                "%s: %d messages lie behind those of other topics that are later by more than a second, so colour and "
                "depth did not come together: its topics were written one after the other, with log times that are not "
                "those of the stamps; write it again with each message's stamp as its log time",
                self._reader.path, self._reader.behind,
            )  # fmt: skip
        for damage in self.damage:
            log.warning("%s: %s", self._reader.path, damage)

    @property
    def damage(self) -> list[str]:
        """What is wrong with as much of the recording as was read: the first damages, and how many more."""
        found = self._reader.damage
        more = len(found) - _MOST_TOLD
        rest = [f"{more} more of such damages (all: odom info {self._reader.path})"] if more > 0 else []
        return [*found[:_MOST_TOLD], *rest]

    def _until_end(self, messages: Iterator[Message]) -> Iterator[Message]:
        """Yield the messages stamped before the end; reads on until _MOST_LATE messages in a row are later.

        The first messages may be later than the end too: images from before the camera's clock was set back.
        """
        begun, beyond = False, 0
        for message in messages:
            if self._end is None or message.stamp < self._end:
                begun |= message.topic == self._roles.color.topic
                beyond = 0
                yield message
            elif begun:
                beyond += 1
                if beyond >= _MOST_LATE:
                    return

    def close(self) -> None:
        """End `messages` at the next message."""
        self._closed = True

    def _registered(self, image: Message) -> Message:
        """Return a depth image as colour's camera sees it; what is none, or of another size, is refused later on."""
        if self.registration is None or image.topic not in (self._topics.depth, self._topics.depth_compressed):
            return image
        try:
            depth_mm = self.registration(decode_depth(image))
        except (ConfigError, WireError):
            return image
        return encode_depth(self._topics.depth, image.stamp, depth_mm, self._topics.frame_camera)

    def _as_calibration(self, message: Message) -> Message:
        """Return the calibration of the images as they are: a rectified image has the new matrix, no distortion."""
        if not self._roles.rectified:
            return replace(message, topic=self._info_key)
        return encode_camera_info(self._info_key, message.stamp, decode_camera_info(message, rectified=True))


def open_recording(path: Path, options: SourceOptions) -> ReplaySource:
    """Open an MCAP recording or a ROS 2 bag folder, any with colour, depth and calibration; cut ones too.

    Raises RecordingError when it is none or lacks a stream, ConfigError when a named topic is not in it.
    """
    reader = open_reader(path)
    counts = reader.counts()
    streams = reader.streams(_PEEK_BYTES, counts)
    if counts is None:
        log.warning(
            "%s was cut off or its index is damaged: what is whole is played (mend it with: odom recover %s OUT.mcap)",
            path,
            path,
        )
    if not streams:
        raise RecordingError("; ".join((f"{path} holds no ROS 2 messages", *reader.skipped_in_words(), *reader.damage)))
    source = ReplaySource(reader, streams, counts or {}, options)
    log.info("%s: %s", path, source.taken)
    if source.could_be_truth is not None:
        log.info("%s: %s", path, source.could_be_truth)
    for doubt in source.doubts:
        log.warning("%s: %s", path, doubt)
    return source


def _is_raw(stream: RecordedStream) -> bool:
    return stream.type_name == cdr.IMAGE
