import logging
from dataclasses import replace

import numpy as np
import pytest
from made_up_messages import BEGIN, kinect_depth, session_messages, textured

from odom.frame import Camera, Stamp
from odom.wire import Message, Topics
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import cdr, encode_camera_info, encode_color, encode_depth

TOPICS = Topics()


def test_a_session_becomes_its_frames() -> None:
    assembler = FrameAssembler(TOPICS)
    frames = [frame for message in session_messages(10) for frame in assembler.feed(message)]
    frames += assembler.finish()
    assert [frame.sequence for frame in frames] == list(range(10))
    assert np.array_equal(frames[3].depth_mm, kinect_depth(seed=3))
    assert frames[3].stamp - frames[3].depth_stamp == 5_000_000
    assert assembler.camera is not None
    assert not assembler.malformed.counts


def test_what_cannot_be_used_is_counted_logged_once_and_passed_over(caplog: pytest.LogCaptureFixture) -> None:
    """Between good frames, three times each: garbage on every key, and images that do not fit."""
    good = session_messages(20)
    stamp = Stamp(BEGIN + 200_000_000)
    garbage = [
        Message(key, type_name, stamp, payload)
        for key in (TOPICS.color, TOPICS.color_compressed, TOPICS.depth, TOPICS.depth_compressed, TOPICS.camera_info)
        for type_name in (cdr.IMAGE, cdr.COMPRESSED_IMAGE, cdr.CAMERA_INFO, "evil/msg/Type")
        for payload in (b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 100)
    ]
    nan = replace(encode_camera_info(TOPICS.camera_info, stamp, Camera(64, 48, 50, 50, 32, 24)))
    at = nan.payload.index(np.float64(50).tobytes())
    nan = replace(nan, payload=nan.payload[:at] + np.float64(np.nan).tobytes() + nan.payload[at + 8 :])
    assembler = FrameAssembler(TOPICS)
    frames = 0
    with caplog.at_level(logging.WARNING):
        for i, message in enumerate(good):
            frames += len(assembler.feed(message))
            if i in (20, 30, 40):
                for bad in [*garbage, nan]:
                    frames += len(assembler.feed(bad))
    frames += len(assembler.finish())
    assert frames == 20
    assert assembler.malformed.counts.total() == 3 * (len(garbage) + 1)
    assert len(caplog.records) == len(assembler.malformed.counts)


def test_images_of_another_size_are_refused() -> None:
    assembler = FrameAssembler(TOPICS)
    assembler.feed(session_messages(1)[0])
    assert assembler.feed(encode_color(TOPICS.color, Stamp(BEGIN), textured(24, 32))) == ()
    assert assembler.feed(encode_depth(TOPICS.depth, Stamp(BEGIN), kinect_depth())) == ()
    assert assembler.malformed.counts[TOPICS.depth] == 1
    assert assembler.feed(encode_color(TOPICS.color, Stamp(BEGIN + 10**8), textured(24, 32))) == ()
    assert assembler.feed(encode_depth(TOPICS.depth, Stamp(BEGIN + 10**8), kinect_depth(24, 32))) == ()
    assert assembler.malformed.counts[TOPICS.camera_info] == 1
