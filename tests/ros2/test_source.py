"""`ros2:/camera`: topics of drivers as they are, found and read through a router of ROS 2."""

import logging
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
import pytest
from ros2_network import DOMAIN, driver, free_port, other_node, router

from odom.errors import ConfigError, SourceError
from odom.frame import Camera, Stamp
from odom.wire import Message, Topics, WireSettings
from odom.wire.codec import (
    cdr,
    decode_camera_info,
    decode_color,
    decode_depth,
    encode_camera_info,
    encode_color,
    encode_color_jpeg,
    encode_depth,
    encode_depth_compressed,
    encode_tf,
    restamp,
)
from odom.wire.codec.cdr import IMAGE
from odom.wire.ros2 import Ros2Node, check_no_loop
from odom.wire.ros2.inbox import Inbox
from odom.wire.ros2.names import Endpoint, NodeName
from odom.wire.ros2.qos import Qos
from sensors.calibration_file import Calibration, calibration_text
from sensors.catalogue import check_source, open_source
from sensors.depth_registration import DepthRegistration, registration_text
from sensors.ros2 import search
from sensors.ros2.catching_up import CatchingUp
from sensors.source import Source, SourceOptions

KEYS = Topics()
CAMERA = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
AT = Stamp(1_700_000_000_000_000_000)
OPTICAL = "camera_color_optical_frame"
SMOOTH = cv2.resize(np.random.default_rng(0).integers(0, 256, (6, 8, 3), dtype=np.uint8), (64, 48))
DEPTH = np.full((48, 64), 1500, np.uint16)
INFO = encode_camera_info("camera/color/camera_info", AT, CAMERA, OPTICAL)
COLOR = encode_color("camera/color/image_raw", AT, SMOOTH, OPTICAL)
ALIGNED = encode_depth("camera/aligned_depth_to_color/image_raw", AT, DEPTH, OPTICAL)


def image(topic: str, encoding: str, pixels: np.ndarray, frame: str = OPTICAL) -> Message:
    height, width = pixels.shape[:2]
    fields: dict[str, Any] = {"height": height, "width": width, "encoding": encoding, "is_bigendian": 0}
    data = np.ascontiguousarray(pixels)
    flat = data.reshape(-1).view(np.uint8)
    return cdr.encode(topic, cdr.IMAGE, AT, frame, step=data.strides[0], data=flat, **fields)


def options(port: int, **extra: str) -> SourceOptions:
    given = {"domain": str(DOMAIN), "router": f"tcp/127.0.0.1:{port}"} | extra
    return SourceOptions(topics=KEYS, extra=tuple(given.items()))


def some(source: Source, count: int = 40) -> list[Message]:
    with closing(source):
        return list(islice(source.messages(), count))


def opened(port: int, messages: Sequence[Message], **extra: str) -> list[Message]:
    with driver(port, messages):
        return some(open_source("ros2:/camera", options(port, **extra)))


def of(messages: list[Message], *topics: str) -> Message:
    return next(message for message in messages if message.topic in topics)


def refusal(port: int, messages: Sequence[Message]) -> str:
    with driver(port, messages), pytest.raises(SourceError) as error:
        open_source("ros2:/camera", options(port, start_s="2.5"))
    return str(error.value)


Look = Callable[[int], Any]


def at_once(*looks: Look) -> list[Any]:
    """What several looks at a driver give, each by a router of its own: they mostly wait, so they wait together."""

    def alone(look: Look) -> Any:
        port = free_port()
        with router(port):
            return look(port)

    with ThreadPoolExecutor(len(looks)) as pool:
        return list(pool.map(alone, looks))


def refused(*messages: Message) -> Look:
    return lambda port: refusal(port, messages)


def read(*messages: Message, **extra: str) -> Look:
    return lambda port: opened(port, messages, **extra)


def test_a_foreign_publisher_feeds_the_source(port: int) -> None:
    pytest.importorskip("zenoh_ros2_sdk", reason="the wheel zenoh-ros2-sdk is missing")
    camera = str(Path(__file__).with_name("sdk_camera.py"))
    with subprocess.Popen([sys.executable, camera, str(port), str(DOMAIN)]) as process:
        try:
            messages = some(open_source("ros2:/camera", options(port, start_s="20")), 40)
        finally:
            process.kill()
    assert decode_camera_info(of(messages, KEYS.camera_info)) == Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
    expected = np.arange(64 * 48 * 3, dtype=np.uint32).astype(np.uint8).reshape(48, 64, 3)[..., ::-1]
    assert np.array_equal(decode_color(of(messages, KEYS.color)), expected)
    assert (decode_depth(of(messages, KEYS.depth)) == 1500).all()


RGBA = np.dstack([SMOOTH, np.full((48, 64), 255, np.uint8)])
GREY = cv2.cvtColor(SMOOTH, cv2.COLOR_RGB2GRAY)
YUYV = cv2.cvtColor(SMOOTH, cv2.COLOR_RGB2YUV_YUY2)


ENCODED = {
    "bgr8": (SMOOTH[..., ::-1], 0),
    "bgra8": (RGBA[..., [2, 1, 0, 3]], 0),
    "mono8": (GREY, 0),
    "yuyv": (YUYV, 40),
    "yuv422_yuy2": (YUYV, 40),
}
"""Pixels in each encoding, and by how much what is read of them may be off."""


def test_colour_of_any_encoding_is_read() -> None:
    looks = [read(INFO, image(COLOR.topic, encoding, pixels), ALIGNED) for encoding, (pixels, _) in ENCODED.items()]
    for (encoding, (_, tolerance)), messages in zip(ENCODED.items(), at_once(*looks), strict=True):
        found = decode_color(of(messages, KEYS.color)).astype(int)
        assert np.abs(found - (GREY if encoding == "mono8" else SMOOTH)).max() <= tolerance, encoding


def test_what_is_offered_compressed_only_is_read_so_and_raw_is_taken_of_both() -> None:
    jpeg = encode_color_jpeg("camera/color/image_raw/compressed", AT, SMOOTH, OPTICAL)
    png = encode_depth_compressed("camera/depth/image_raw/compressedDepth", AT, DEPTH, OPTICAL, "png")
    strange = replace(jpeg, topic="camera/color/image_raw/compressedDepth")
    both = [INFO, COLOR, jpeg, ALIGNED]
    messages, raw, compressed = at_once(
        read(INFO, jpeg, png, strange), read(*both), read(*both, transport="compressed")
    )
    assert of(messages, KEYS.color_compressed).payload[12:] == jpeg.payload[12:]
    assert (decode_depth(of(messages, KEYS.depth_compressed)) == DEPTH).all()
    assert of(raw, KEYS.color, KEYS.color_compressed).topic == KEYS.color
    assert of(compressed, KEYS.color, KEYS.color_compressed).topic == KEYS.color_compressed


def test_a_compressed_topic_that_comes_after_the_raw_one_is_taken_where_it_was_asked_for(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(search, "_SETTLING_S", 5.0)  # a slow machine starts the second driver in time, too
    jpeg = encode_color_jpeg("camera/color/image_raw/compressed", AT, SMOOTH, OPTICAL)
    with ThreadPoolExecutor(1) as pool, driver(port, [INFO, COLOR, ALIGNED]):
        opening = pool.submit(open_source, "ros2:/camera", options(port, transport="compressed", start_s="30"))
        time.sleep(0.6)
        with driver(port, [jpeg], "late_transport"):
            messages = some(opening.result(), 80)
    assert of(messages, KEYS.color, KEYS.color_compressed).topic == KEYS.color_compressed


def test_aligned_depth_is_taken_before_the_sensors_own_and_other_cameras_are_left_alone(port: int) -> None:
    own = encode_depth("camera/depth/image_rect_raw", AT, DEPTH + 7, "camera_depth_optical_frame")
    infra = image("camera/infra1/image_rect_raw", "mono8", GREY)
    other = encode_color("rear/color/image_raw", AT, SMOOTH, "rear_optical_frame")
    messages = opened(port, [INFO, infra, other, COLOR, own, ALIGNED])
    assert (decode_depth(of(messages, KEYS.depth)) == 1500).all()


def test_depth_of_its_own_camera_is_registered_by_tf_static_or_a_file(tmp_path: Path) -> None:
    small = Camera(32, 24, 25.0, 25.0, 15.5, 11.5)
    T = np.eye(4)
    T[0, 3] = 0.15  # 5 px of 50 px focal length at 1.5 m
    plane = np.full((24, 32), 1500, np.uint16)
    plane[:, :16] = 0
    depth = encode_depth("camera/depth/image_rect_raw", AT, plane, "camera_depth_optical_frame")
    depth_info = encode_camera_info("camera/depth/camera_info", AT, small, "camera_depth_optical_frame")
    middle = ("camera_link", OPTICAL, np.eye(4)), ("camera_link", "camera_depth_optical_frame", T)
    tf = encode_tf(AT, middle, topic="tf_static")
    file = tmp_path / "camera.yaml"
    camera = decode_camera_info(INFO)
    file.write_text(calibration_text(Calibration(camera)) + registration_text(DepthRegistration(small, camera, T)))

    def by_file(port: int) -> list[Message]:
        with driver(port, [INFO, COLOR, depth]):
            return some(open_source("ros2:/camera", replace(options(port), camera=file)))

    messages, by_the_file, untold, unsized = at_once(
        read(INFO, COLOR, depth, depth_info, tf),
        by_file,
        refused(INFO, COLOR, depth, depth_info),
        refused(INFO, COLOR, depth, tf),
    )
    registered = decode_depth(of(messages, KEYS.depth))
    assert np.array_equal(decode_depth(of(by_the_file, KEYS.depth)), registered)
    assert registered.shape == (48, 64)
    first = np.flatnonzero(registered[24])[0]
    assert 36 <= first <= 38
    assert (registered[24, 40:60] == 1500).all()
    assert "/tf_static does not say" in untold
    assert "no camera_info of its size" in unsized


def test_of_a_recording_that_waits_to_be_played_no_image_is_lost(port: int) -> None:
    with other_node(port) as session:
        node = Ros2Node(session.zenoh, NodeName(DOMAIN, str(session.zenoh.info.zid()), 0, "/", "player"))
        for message in (INFO, COLOR, ALIGNED):
            node.offer(message.topic, message.type_name, Qos())

        def play() -> None:
            for i in range(1, 11):
                for message in (INFO, COLOR, ALIGNED):
                    node.tell(restamp(message, Stamp(i)))
                time.sleep(0.01)

        timer = threading.Timer(2.0, play)  # long after the source has begun to look
        timer.start()
        source = open_source("ros2:/camera", options(port, start_s="30"))
        time.sleep(1.0)  # until the odometry is there
        messages = some(source, 25)
        timer.join()
        node.close()
    for topic in (KEYS.color, KEYS.depth):
        stamps = [message.stamp for message in messages if message.topic == topic]
        assert stamps == list(range(1, len(stamps) + 1))
        assert len(stamps) > 6


def test_what_went_by_before_it_could_be_taken_is_told(port: int, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO), driver(port, [INFO, COLOR, ALIGNED], period_s=0.01):
        source = open_source("ros2:/camera", options(port))
        time.sleep(2.0)
        messages = some(source)
    assert "messages came before they could be taken, and were dropped for newer ones" in caplog.text
    assert messages[-1].stamp > time.time_ns() - 10**9


def test_what_waited_is_handed_out_half_as_fast_again_as_it_was_taken() -> None:
    inbox = FilledInbox([Message("/image", IMAGE, Stamp(i * 30_000_000), b"") for i in range(10)])
    arrivals = CatchingUp(cast(Inbox, inbox), depth=4)
    begun = time.monotonic()
    taken = [arrivals.receive(0.0) for _ in range(10)]
    assert time.monotonic() - begun > 0.16
    assert [message.stamp for message in taken if message is not None] == [i * 30_000_000 for i in range(10)]
    assert arrivals.receive(0.0) is None


class FilledInbox:
    """An inbox in which messages wait."""

    def __init__(self, messages: list[Message]) -> None:
        self.counts, self._waiting = Counter[str](), messages

    def limit(self, depth: int) -> None:
        assert not self._waiting

    def receive(self, timeout: float) -> Message | None:
        return self._waiting.pop(0) if self._waiting else None


def test_topics_may_be_named_wherever_they_are(port: int) -> None:
    far = [replace(m, topic=f"rig/eye/{m.topic.split('/')[-1]}{i}") for i, m in enumerate((INFO, COLOR, ALIGNED))]
    roles = ("camera_info", "color", "depth")
    named = tuple((role, f"/{message.topic}") for role, message in zip(roles, far, strict=True))
    with driver(port, far):
        messages = some(open_source("ros2:/", replace(options(port), topics_from=named)))
    assert np.array_equal(decode_color(of(messages, KEYS.color)), SMOOTH)


def test_what_does_not_come_is_told_in_plain_words() -> None:
    elsewhere = replace(COLOR, topic="rear/image")
    nobody, other, no_info, no_depth = at_once(
        refused(), refused(elsewhere), refused(COLOR, ALIGNED), refused(INFO, COLOR)
    )
    assert f"no ROS 2 publisher is seen in domain {DOMAIN}" in nobody
    assert f"no images below /camera in domain {DOMAIN}; published are: /rear/image" in other
    assert no_info.startswith("no camera_info for 2.5 s: none is published below /camera: give --camera camera.yaml")
    assert "no depth images; published are /camera/color/" in no_depth


def test_a_type_of_another_definition_is_refused_by_its_node(port: int) -> None:
    with other_node(port) as session:
        node = NodeName(DOMAIN, str(session.zenoh.info.zid()), 0, "/", "old_camera")
        image_of_it = Endpoint(node, 1, "MP", "/camera/image_raw", "sensor_msgs/msg/Image", "RIHS01_" + "0" * 64, Qos())
        session.announce(image_of_it.token())
        with pytest.raises(ConfigError, match="/camera/image_raw of /old_camera is of another sensor_msgs/msg/Image"):
            open_source("ros2:/camera", options(port, start_s="5"))


def test_two_nodes_on_one_topic_are_told_by_name(port: int, caplog: pytest.LogCaptureFixture) -> None:
    everything = [INFO, COLOR, ALIGNED]
    with driver(port, everything, "front"), driver(port, everything, "rear"):
        some(open_source("ros2:/camera", options(port)))
    assert "2 nodes publish /camera/color/image_raw: /front, /rear; their messages alternate" in caplog.text


def test_silence_is_told_and_the_source_ends_where_that_is_asked(port: int, caplog: pytest.LogCaptureFixture) -> None:
    with driver(port, [INFO, COLOR, ALIGNED]):
        source = open_source("ros2:/camera", options(port, silence_s="0.5", end_s="1.5"))
    with closing(source):
        begun = time.monotonic()
        list(source.messages())
        assert 1.0 < time.monotonic() - begun < 6.0
    assert (
        "nobody publishes /camera/color/image_raw and /camera/aligned_depth_to_color/image_raw any more" in caplog.text
    )


def test_closing_ends_the_messages_from_another_thread(port: int) -> None:
    with driver(port, [INFO, COLOR, ALIGNED]):
        source = open_source("ros2:/camera", options(port))
        timer = threading.Timer(0.5, source.close)
        timer.start()
        assert sum(1 for _ in endless(source)) > 3


def endless(source: Source) -> Iterator[Message]:
    yield from source.messages()


@pytest.mark.parametrize("spec", ["ros2:/a b", "ros2:/1x", "ros2:/a//b", "ros2:/a*"])
def test_what_is_no_beginning_of_a_topic_is_refused(spec: str) -> None:
    with pytest.raises(ConfigError, match="give ros2:/NAME"):
        check_source(spec, SourceOptions())


@pytest.mark.parametrize(("name", "value"), [("domain", "300"), ("transport", "h264"), ("router", "here"), ("x", "1")])
def test_options_that_cannot_be_are_refused(name: str, value: str) -> None:
    with pytest.raises(ConfigError, match=f"ros2 option {name}"):
        check_source("ros2:/camera", SourceOptions(extra=((name, value),)))


def test_a_source_that_would_hear_itself_is_refused() -> None:
    shown = WireSettings(ros2_domain=0, namespace="cam0")
    for source in ("ros2:/cam0", "ros2:/cam0/"):
        with pytest.raises(ConfigError, match="give another --namespace"):
            check_no_loop(source, shown)
    for source, wire in (("ros2:/camera", shown), ("ros2:/cam0", WireSettings()), ("cam0", shown)):
        check_no_loop(source, wire)
