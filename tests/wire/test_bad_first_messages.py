"""Recordings and drivers whose first image or calibration is empty or cut, as of some that start up."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
import pytest
from made_up_bags import frames_in, record
from made_up_messages import BEGIN, PERIOD_NS, kinect_depth, textured

from odom.frame import Camera, Stamp
from odom.wire import Message
from odom.wire.codec import cdr, encode_camera_info, encode_color_jpeg, encode_depth
from odom.wire.codec import image_messages as images
from odom.wire.ros2.names import NO_TYPE_HASH, Endpoint, NodeName
from odom.wire.ros2.qos import Qos
from sensors.ros2.search import Search
from sensors.ros2.settings import Ros2Settings

CAMERA = Camera(64, 48, 50.0, 51.0, 31.0, 23.0)
COLOR, DEPTH, INFO = "camera/color/image_raw/compressed", "camera/aligned_depth/image_raw", "camera/color/camera_info"
FRAMES = 6


def walk() -> list[Message]:
    stamps = [Stamp(BEGIN + i * PERIOD_NS) for i in range(FRAMES)]
    return [
        message
        for stamp in stamps
        for message in (
            encode_color_jpeg(COLOR, stamp, textured()),
            encode_camera_info(INFO, stamp, CAMERA),
            encode_depth(DEPTH, stamp, kinect_depth()),
        )
    ]


def cut(whole: Message) -> Message:
    file = cv2.imencode(".jpg", textured())[1].tobytes()
    return images._encode_compressed(whole.topic, whole.stamp, "jpeg", file[: len(file) // 2], "camera")


def empty_depth(whole: Message) -> Message:
    nothing = np.zeros(0, np.uint8)
    return cdr.encode(
        whole.topic, cdr.IMAGE, whole.stamp, "camera", height=0, width=0, encoding="", is_bigendian=0, step=0,
        data=nothing,
    )  # fmt: skip


def empty_info(whole: Message) -> Message:
    told = cdr.deserialise(whole, cdr.CAMERA_INFO)
    empty = replace(told, height=0, width=0, k=np.zeros(9), p=np.zeros(12))
    return cdr.serialise(whole.topic, cdr.CAMERA_INFO, whole.stamp, empty)


BAD: dict[str, Callable[[Message], Message]] = {COLOR: cut, DEPTH: empty_depth, INFO: empty_info}


def spoilt(topic: str) -> list[Message]:
    messages = walk()
    first = next(k for k, message in enumerate(messages) if message.topic == topic)
    return [*messages[:first], BAD[topic](messages[first]), *messages[first + 1 :]]


@pytest.mark.parametrize("topic", BAD)
def test_a_recording_whose_first_message_is_bad_is_played_by_the_next(tmp_path: Path, topic: str) -> None:
    frames, assembler = frames_in(record(tmp_path / "bag", spoilt(topic)))
    assert len(frames) == FRAMES - (topic == COLOR)
    assert assembler.camera == CAMERA


class Played:
    """A graph and an inbox of a driver that sends these messages and listens to nothing."""

    def __init__(self, messages: list[Message]) -> None:
        self._waiting = tuple(replace(message, topic=f"/{message.topic}") for message in messages)
        self._types = {message.topic: message.type_name for message in self._waiting}
        self.topics: tuple[str, ...] = ()

    def endpoints(self, prefix: str = "/") -> dict[str, list[Endpoint]]:
        node = NodeName(0, "a", 0, "/", "driver")
        return {t: [Endpoint(node, 1, "MP", t, name, NO_TYPE_HASH, Qos())] for t, name in self._types.items()}

    def subscribe(self, publisher: Endpoint) -> None:
        self.topics = (*self.topics, publisher.topic)

    def unsubscribe(self, topic: str) -> None:
        self.topics = tuple(other for other in self.topics if other != topic)

    def waiting(self) -> tuple[Message, ...]:
        return self._waiting


@pytest.mark.parametrize("topic", BAD)
def test_a_driver_whose_first_message_is_bad_is_found_by_the_next(topic: str) -> None:
    driver = cast(Any, Played(spoilt(topic)))
    found = Search(driver, driver, "/camera", Ros2Settings(start_s=5), {}, None, None).run()
    assert (found.streams.color.topic, found.streams.depth.topic) == (COLOR, DEPTH)
    assert found.streams.camera() == CAMERA
