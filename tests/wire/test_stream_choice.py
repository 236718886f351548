"""Which topics are taken where a recording holds several cameras."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from made_up_messages import BEGIN, kinect_depth, textured

from odom.frame import Camera, DepthModel, Stamp
from odom.wire import Message, Topics
from odom.wire.codec import decode_depth_model, encode_calibration, encode_camera_info, encode_color, encode_depth
from odom.wire.codec import image_messages as images
from odom.wire.recording import RecordedStream, SelectedStreams, select_streams
from odom.wire.recording.image_kind import image_kind
from sensors.recorded_depth import recorded_depth_model

CAMERA = Camera(64, 48, 50.0, 51.0, 31.0, 23.0)


def streams(*messages: Message, count: Callable[[str], int] = lambda topic: 10) -> list[RecordedStream]:
    """Streams of one message each that say that they are `count` long, by topic."""
    return [RecordedStream(m.topic, m.type_name, m, m.stamp, m.stamp, count(m.topic)) for m in messages]


def color(topic: str, frame: str = "camera") -> Message:
    return encode_color(topic, Stamp(BEGIN), textured(), frame)


def depth(topic: str, frame: str = "camera") -> Message:
    return encode_depth(topic, Stamp(BEGIN), kinect_depth(), frame)


def info(topic: str) -> Message:
    return encode_camera_info(topic, Stamp(BEGIN), CAMERA)


def deep_png(topic: str, grey: np.ndarray, told: str) -> Message:
    return images._encode_compressed(topic, Stamp(BEGIN), told, cv2.imencode(".png", grey)[1].tobytes(), "camera")


def topics(selected: SelectedStreams) -> tuple[str, str]:
    return selected.color.topic, selected.depth.topic


TWO_CAMERAS = (
    color("front/color/image_raw", "front"),
    info("front/color/camera_info"),
    color("rs/color/image_raw", "rs_color"),
    info("rs/color/camera_info"),
    depth("rs/aligned_depth_to_color/image_raw", "rs_color"),
)


def test_colour_is_that_of_the_camera_that_has_depth_though_another_has_more_images() -> None:
    held = streams(*TWO_CAMERAS, count=lambda topic: 30 if topic.startswith("front") else 15)
    selected = select_streams(held, {})
    assert topics(selected) == ("rs/color/image_raw", "rs/aligned_depth_to_color/image_raw")
    assert selected.camera_info is not None
    assert selected.camera_info.topic == "rs/color/camera_info"


def test_colour_that_is_named_wins_over_the_camera_that_has_depth() -> None:
    selected = select_streams(streams(*TWO_CAMERAS), {"color": "/front/color/image_raw"})
    assert selected.color.topic == "front/color/image_raw"


def test_colour_of_a_stereo_camera_is_the_image_in_whose_frame_depth_is() -> None:
    sides = [color(f"zed/{side}/image_rect_color", side) for side in ("right", "left")]
    held = streams(
        *sides, depth("zed/depth/depth_registered", "left"), count=lambda topic: 10 + topic.startswith("zed/right")
    )
    assert select_streams(held, {}, need_calibration=False).color.topic == "zed/left/image_rect_color"


@pytest.mark.parametrize("device", ["front", "back"])
def test_colour_is_of_the_device_whose_depth_is_named(device: str) -> None:
    held = streams(
        *(color(f"{each}/rgb/image_raw", f"{each}_rgb") for each in ("front", "back")),
        *(depth(f"{each}/depth/image_raw", f"{each}_depth") for each in ("front", "back")),
    )
    selected = select_streams(held, {"depth": f"/{device}/depth/image_raw"}, need_calibration=False)
    assert topics(selected) == (f"{device}/rgb/image_raw", f"{device}/depth/image_raw")


def test_depth_is_of_the_device_whose_colour_is_named_though_anothers_is_registered() -> None:
    held = streams(
        *(color(f"{each}/color/image_raw", f"{each}_color") for each in ("front", "back")),
        depth("front/depth/image_raw", "front_depth"),
        depth("back/aligned_depth_to_color/image_raw", "back_color"),
    )
    selected = select_streams(held, {"color": "/front/color/image_raw"}, need_calibration=False)
    assert selected.depth.topic == "front/depth/image_raw"


def test_infrared_images_in_depths_frame_are_not_taken_where_there_is_colour() -> None:
    grey = encode_color("k4a/ir/image_raw", Stamp(BEGIN), np.ascontiguousarray(textured()[..., 0]), "depth")
    held = streams(grey, color("k4a/rgb/image_raw", "rgb"), depth("k4a/depth/image_raw", "depth"))
    assert select_streams(held, {}, need_calibration=False).color.topic == "k4a/rgb/image_raw"


@pytest.mark.parametrize("transport", ["png compressed ", "compressedDepth png"])
def test_compressed_grey_in_16_bits_is_seen_or_depth_by_its_name_as_uncompressed(transport: str) -> None:
    grey = (textured()[..., 0].astype(np.uint16) * 4, f"mono16; {transport}")
    is_depth = [image_kind(deep_png(topic, *grey)) == "depth" for topic in ("k4a/ir/image/compressed", "k4a/depth")]
    assert is_depth == [transport.startswith("compressedDepth"), True]


@pytest.mark.parametrize(
    ("topic", "is_rectified"),
    [
        ("kinect2/qhd/image_color_rect", True),
        ("rgb/image_rect_color/compressed", True),
        ("left/image_rectified", True),
        ("rgb/image_raw", False),
        ("direct/image_color", False),
    ],
)
def test_colour_is_rectified_where_its_name_says_so_wherever_the_word_stands(topic: str, is_rectified: bool) -> None:
    selected = select_streams(streams(color(topic), depth("depth"), info("camera_info")), {})
    assert selected.rectified == is_rectified


@pytest.mark.parametrize("chosen", ["cam0", "cam1", "cam2"])
def test_the_model_of_depths_errors_is_of_the_device_that_is_played(chosen: str) -> None:
    """Of three devices of which the last has none."""
    models = {"cam0": DepthModel(shift_px=(2.0, 0.5)), "cam1": DepthModel(shift_px=(-3.0, 1.0))}
    messages: list[Message] = []
    for device in ("cam0", "cam1", "cam2"):
        keys = Topics(device)
        camera = replace(CAMERA, depth=models.get(device, DepthModel()))
        messages += encode_calibration((keys.camera_info, keys.depth_info), Stamp(BEGIN), camera)
        messages += [color(keys.color), depth(keys.depth)]
    held = streams(*messages)
    found = recorded_depth_model(select_streams(held, {"color": Topics(chosen).color}), held)
    assert (None if found is None else decode_depth_model(found)) == models.get(chosen)
