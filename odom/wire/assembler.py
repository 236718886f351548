"""From wire messages to RGB-D frames: decoding, calibration and pairing, with every refusal counted."""

from dataclasses import replace

import numpy as np

from odom.errors import WireError
from odom.frame import Camera, DepthModel, RgbdFrame, Stamp
from odom.geometry.arrays import Image
from odom.wire.codec import decode_camera_info, decode_color, decode_depth, decode_depth_model
from odom.wire.codec.compressed_depth import Depth
from odom.wire.image_counts import OTHER_SIZE, UNREADABLE, ImageCounts
from odom.wire.malformed_counter import MalformedCounter
from odom.wire.message import Message
from odom.wire.pairing import Pair, Pairer
from odom.wire.topics import Topics


class FrameAssembler:
    """Turns one device's messages into frames; its result depends only on the messages and their order.

    Every colour image becomes a frame, with an empty depth image if it has none. What cannot be used is counted in
    `malformed`, which may be the receiver's own; `pairing` counts what became of the images; `camera` is the latest
    calibration.
    """

    def __init__(self, topics: Topics, grey: bool = False, malformed: MalformedCounter | None = None) -> None:
        self.camera: Camera | None = None
        self._depth_model = DepthModel()
        self.malformed = MalformedCounter() if malformed is None else malformed
        self._topics = topics
        self._grey = grey
        self._pairer: Pairer[Image, Depth] = Pairer()
        self.pairing = self._pairer.counters
        self._sequence = 0

    @property
    def newest_color(self) -> tuple[Stamp, Image] | None:
        """The newest colour image that still waits for a depth image, None without one."""
        return self._pairer.newest_color

    def feed(self, message: Message) -> tuple[RgbdFrame, ...]:
        """Take a message of the device and return the frames that are complete by it.

        Messages of other keys are ignored; what cannot be decoded is counted and dropped.
        """
        topics, key = self._topics, message.topic
        try:
            if key in topics.color_keys:
                return self._frames(self._pairer.add_color(message.stamp, decode_color(message, self._grey)))
            if key in topics.depth_keys:
                return self._frames(self._pairer.add_depth(message.stamp, decode_depth(message)))
            if key == topics.camera_info:
                self.camera = replace(decode_camera_info(message), depth=self._depth_model)
            if key == topics.depth_info:
                self._take_depth_model(message)
        except WireError as error:
            self.malformed.add(key, str(error))
            if key not in (topics.camera_info, topics.depth_info):
                self._counts(key).given += 1
                self._counts(key).refuse(UNREADABLE)
        return ()

    def _take_depth_model(self, message: Message) -> None:
        model = decode_depth_model(message)
        if model is not None:
            self._depth_model = model
            self.camera = None if self.camera is None else replace(self.camera, depth=model)

    def finish(self) -> tuple[RgbdFrame, ...]:
        """Return the frames that were still waiting for a nearer partner when the source ended."""
        return self._frames(self._pairer.finish())

    def _frames(self, pairs: list[Pair[Image, Depth]]) -> tuple[RgbdFrame, ...]:
        frames = []
        for pair in pairs:
            camera, size = self.camera, pair.color.shape[:2]
            depth = np.zeros(size, dtype=np.uint16) if pair.depth is None else pair.depth
            if depth.shape != size:
                self.malformed.add(self._topics.depth, f"depth of {depth.shape} is not registered to colour of {size}")
                self._withdraw(pair)
                continue
            if camera is not None and (camera.height, camera.width) != size:
                self.malformed.add(self._topics.camera_info, f"calibration is not that of colour of {size}: {camera}")
                self._withdraw(pair)
                continue
            frames.append(RgbdFrame(self._sequence, pair.color_stamp, pair.color, pair.depth_stamp, depth))
            self._sequence += 1
        return tuple(frames)

    def _counts(self, key: str) -> ImageCounts:
        is_color = key in self._topics.color_keys
        return self.pairing.color if is_color else self.pairing.depth

    def _withdraw(self, pair: Pair[Image, Depth]) -> None:
        self.pairing.color.withdraw(OTHER_SIZE)
        if pair.depth is not None:
            self.pairing.depth.withdraw(OTHER_SIZE)
