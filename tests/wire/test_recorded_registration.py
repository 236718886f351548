"""Recordings of drivers that do not register depth to colour: it is registered by what they hold, or by a file."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_bags import frames_in, record, record_ros_1
from made_up_messages import BEGIN, PERIOD_NS, kinect_depth, textured
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin
from scipy.spatial.transform import Rotation

from odom.errors import RecordingError
from odom.frame import Camera, Stamp
from odom.service.calibration_offer import CALIBRATION_FILE, keep_depth_images
from odom.wire import Message
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import encode_camera_info, encode_color, encode_depth, encode_tf
from sensors.calibration_file import Calibration, calibration_text
from sensors.catalogue import open_source
from sensors.depth_registration import DepthRegistration, registration_text
from sensors.source import SourceOptions

COLOR, DEPTH = Camera(64, 48, 50.0, 51.0, 31.0, 23.0), Camera(80, 48, 45.0, 45.0, 40.0, 24.0)
FRAMES = 4


def motion(rotvec: tuple[float, float, float], position: tuple[float, float, float]) -> NDArray[np.float64]:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(rotvec).as_matrix(), position
    return T


OPTICAL = motion((-np.pi / 2, 0.0, 0.0), (0.0, 0.0, 0.0))
T_LINK_COLOR, T_LINK_DEPTH = motion((0.01, 0.02, 0.0), (0.0, 0.015, 0.0)), motion((0.0, 0.0, 0.0), (0.0, -0.05, 0.0))
FRAMES_OF_THE_RIG = [
    [("link", "color", T_LINK_COLOR), ("color", "color_optical", OPTICAL)],
    [("link", "depth", T_LINK_DEPTH), ("depth", "depth_optical", OPTICAL)],
]
T_COLOR_DEPTH = np.linalg.inv(T_LINK_COLOR @ OPTICAL) @ T_LINK_DEPTH @ OPTICAL


def images(depth_camera: Camera = DEPTH) -> Iterator[Message]:
    for i in range(FRAMES):
        stamp = Stamp(BEGIN + i * PERIOD_NS)
        depth_mm = kinect_depth(depth_camera.height, depth_camera.width, seed=i)
        yield encode_depth("camera/depth/image_rect_raw", stamp, depth_mm, "depth_optical")
        yield encode_camera_info("camera/depth/camera_info", stamp, depth_camera, "depth_optical")
        yield encode_color("camera/color/image_raw", stamp, textured(seed=i), "color_optical")
        yield encode_camera_info("camera/color/camera_info", stamp, COLOR, "color_optical")


def transforms(topic: str = "tf_static") -> Iterator[Message]:
    """What two publishers say of the rig, each with a message of its own."""
    for part in FRAMES_OF_THE_RIG:
        yield encode_tf(Stamp(BEGIN), part, topic)


def depths(recording: Path, options: SourceOptions | None = None) -> tuple[list[NDArray[np.uint16]], FrameAssembler]:
    frames, assembler = frames_in(recording, options)
    return [frame.depth_mm for frame in frames], assembler


def assert_registered(found: list[NDArray[np.uint16]], depth_camera: Camera = DEPTH) -> None:
    register = DepthRegistration(depth_camera, COLOR, T_COLOR_DEPTH)
    assert len(found) == FRAMES
    for i, depth_mm in enumerate(found):
        assert np.array_equal(depth_mm, register(kinect_depth(depth_camera.height, depth_camera.width, seed=i)))


@pytest.mark.parametrize("kind", ["mcap", "database", "ros 1"])
def test_depth_is_registered_by_the_frames_of_the_recording(tmp_path, caplog, kind):
    if kind == "ros 1":  # static_transform_publisher repeats them on /tf
        recording = record_ros_1(tmp_path / "take.bag", (*transforms("tf"), *images()))
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        recording = record(tmp_path / "bag", (*transforms(), *images()), plugin)
    with caplog.at_level("INFO"):
        found, assembler = depths(recording)
    assert_registered(found)
    assert assembler.camera == COLOR
    assert "depth /camera/depth/image_rect_raw (registered here)" in caplog.text
    assert "pixels lie up to" not in caplog.text


def test_depth_in_a_frame_of_its_own_is_registered_though_it_has_colours_size(tmp_path):
    depth_camera = replace(DEPTH, width=64, cx=32.0)
    found, _ = depths(record(tmp_path / "bag", (*transforms(), *images(depth_camera))))
    assert_registered(found, depth_camera)


def test_depth_of_another_size_that_nothing_registers_is_refused_with_what_to_do(tmp_path):
    with pytest.raises(RecordingError, match=r"/tf_static does not say .*T_color_depth in --camera"):
        open_source(str(record(tmp_path / "bag", images())), SourceOptions())


def test_a_calibration_file_that_says_how_the_cameras_lie_to_each_other_registers_depth(tmp_path):
    file = tmp_path / "camera.yaml"
    text = calibration_text(Calibration(COLOR)) + registration_text(DepthRegistration(DEPTH, COLOR, T_COLOR_DEPTH))
    file.write_text(text)
    found, _ = depths(record(tmp_path / "bag", images()), SourceOptions(camera=file))
    assert_registered(found)
    as_color = (replace(m, payload=encode_depth(m.topic, m.stamp, kinect_depth(), "color_optical").payload)
                for m in images() if m.topic == "camera/depth/image_rect_raw")  # fmt: skip
    others = (m for m in images() if m.topic.startswith("camera/color"))
    found, _ = depths(record(tmp_path / "registered", (*others, *as_color)), SourceOptions(camera=file))
    assert all(np.array_equal(depth_mm, kinect_depth()) for depth_mm in found), "registered once more"


def test_a_calibration_that_a_run_found_keeps_how_depth_was_registered(tmp_path):
    recording = record(tmp_path / "bag", (*transforms(), *images()))
    offered = tmp_path / CALIBRATION_FILE
    offered.write_text(calibration_text(Calibration(replace(COLOR, fx=52.0))))
    keep_depth_images(tmp_path, str(recording), None)
    found, assembler = depths(recording, SourceOptions(camera=offered))
    assert assembler.camera is not None
    assert assembler.camera.fx == 52.0
    assert_registered(found)


def test_depth_that_its_driver_has_registered_is_preferred(tmp_path):
    aligned = (
        encode_depth(
            "camera/aligned_depth_to_color/image_raw", Stamp(BEGIN + i * PERIOD_NS), kinect_depth(), "color_optical"
        )
        for i in range(FRAMES)
    )
    found, _ = depths(record(tmp_path / "bag", (*transforms(), *images(), *aligned)))
    assert len(found) == FRAMES
    assert all(np.array_equal(depth_mm, kinect_depth()) for depth_mm in found)


def test_a_depth_image_that_is_none_is_counted_and_the_others_are_registered(tmp_path):
    messages = [*transforms(), *images()]
    last = max(k for k, message in enumerate(messages) if message.topic == "camera/depth/image_rect_raw")
    messages[last] = replace(messages[last], payload=messages[last].payload[:-100])
    found, assembler = depths(record(tmp_path / "bag", iter(messages)))
    assert sum(depth_mm.any() for depth_mm in found if depth_mm is not None) == FRAMES - 1
    assert assembler.malformed.counts.total() == 1
