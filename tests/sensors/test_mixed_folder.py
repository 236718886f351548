"""Colour and depth in one folder are told apart by their names."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from odom.batch.recordings import find_recordings
from odom.errors import ConfigError
from odom.frame import Camera
from odom.rgbd_recording import read_recording
from odom.wire import Topics
from odom.wire.codec import decode_camera_info, decode_color, decode_depth
from sensors.catalogue import open_source
from sensors.default_camera import kinect_camera
from sensors.folder_layouts import is_image_folder, layout_of
from sensors.source import SourceOptions

TOPICS = Topics()
FRAMES = 4
SIZE = 64, 48
CAMERA = Camera(*SIZE, 60.0, 61.0, 31.5, 23.5)
SENS = """m_versionNumber = 4
m_sensorName = StructureSensor
m_colorWidth = 64
m_colorHeight = 48
m_depthWidth = 64
m_depthHeight = 48
m_depthShift = 2000
m_calibrationColorIntrinsic = 60 0 31.5 0 0 61 23.5 0 0 0 1 0 0 0 0 1
m_calibrationColorExtrinsic = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
m_calibrationDepthIntrinsic = 60 0 31.5 0 0 61 23.5 0 0 0 1 0 0 0 0 1
m_frames.size = 4
"""


def write(folder: Path, color_name: str, depth_name: str, units: float = 1000.0) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for i in range(FRAMES):
        cv2.imwrite(str(folder / color_name.format(i)), np.full((*SIZE[::-1], 3), 20 * i, dtype=np.uint8))
        depth = np.full(SIZE[::-1], (1.5 + 0.1 * i) * units, dtype=np.uint16)
        cv2.imwrite(str(folder / depth_name.format(i)), depth)


@pytest.mark.parametrize(
    ("color_name", "depth_name", "first_ns", "step_ns"),
    [
        ("{:05}-color.png", "{:05}-depth.png", 0, 1e9 / 30),
        ("frame-{:06}.color.jpg", "frame-{:06}.depth.png", 0, 1e9 / 30),
        ("rgb_{:04}.png", "depth_{:04}.png", 0, 1e9 / 30),
        ("color{:04}.jpg", "depth{:04}.PNG", 0, 1e9 / 30),
        ("image_{:04}.png", "depth_image_{:04}.png", 0, 1e9 / 30),
        ("aligned_color_{:02}.png", "aligned_depth_to_color_{:02}.png", 0, 1e9 / 30),
        ("w_Color_170000000000{}.5.png", "w_Depth_170000000000{}.500.png", 1_700_000_000_000_500_000, 1e6),
    ],
)
def test_images_of_one_folder_are_told_apart_by_a_word_of_their_names(
    tmp_path: Path, color_name: str, depth_name: str, first_ns: int, step_ns: float
) -> None:
    write(tmp_path / "all" / "walk", color_name, depth_name)
    info, *rest = open_source(str(tmp_path / "all" / "walk"), SourceOptions(topics=TOPICS)).messages()
    assert decode_camera_info(info) == kinect_camera(*SIZE)
    color = [message for message in rest if message.topic == TOPICS.color_compressed]
    depth = [message for message in rest if message.topic == TOPICS.depth]
    stamps = [first_ns + round(i * step_ns) for i in range(FRAMES)]
    assert [message.stamp for message in color] == [message.stamp for message in depth] == stamps
    for i in range(FRAMES):
        assert abs(decode_color(color[i]).astype(int) - 20 * i).max() <= 1
        assert (decode_depth(depth[i]) == 1500 + 100 * i).all()
    assert [found.path for found in find_recordings([tmp_path / "all"])] == [(tmp_path / "all" / "walk").resolve()]


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("intrinsics.txt", "60 0 31.5\n0 61 23.5\n0 0 1\n"),
        ("camera_intrinsic.json", '{"width": 64, "height": 48, "intrinsic_matrix": [60,0,0,0,61,0,31.5,23.5,1]}'),
        ("calibration.txt", "60 61 31.5 23.5\n"),
        ("info.txt", SENS),
    ],
)
@pytest.mark.parametrize("color_name", ["frame-{:06}.color.png", "frame-{:06}.color.jpg"])
def test_a_file_beside_the_images_describes_the_camera_to_which_depth_is_registered(
    tmp_path: Path, color_name: str, file: str, text: str
) -> None:
    write(tmp_path, color_name, "frame-{:06}.depth.png", 2000.0 if file == "info.txt" else 1000.0)
    T = np.eye(4)
    T[:3, 3] = 1.0, 2.0, 3.0
    for i in range(FRAMES):
        np.savetxt(tmp_path / f"frame-{i:06}.pose.txt", T)
    (tmp_path / file).write_text(text)
    info, *rest = open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages()
    assert decode_camera_info(info) == CAMERA
    depth = [decode_depth(message) for message in rest if message.topic == TOPICS.depth]
    assert all((mm == 1500 + 100 * i).all() for i, mm in enumerate(depth))
    assert np.allclose(read_recording(tmp_path).truth()["camera"].T_world_body, T)


def test_depth_of_another_camera_in_info_txt_is_registered_to_colour(tmp_path: Path) -> None:
    write(tmp_path, "frame-{:06}.color.jpg", "frame-{:06}.depth.png", 2000.0)
    (tmp_path / "info.txt").write_text(
        SENS.replace("DepthIntrinsic = 60 0 31.5 0 0 61", "DepthIntrinsic = 80 0 31.5 0 0 80")
    )
    _, *rest = open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages()
    mm = next(decode_depth(message) for message in rest if message.topic == TOPICS.depth)
    assert (mm[:, :7] == 0).all()  # depth sees less to the sides
    assert (mm[10:-10, 12:-12] == 1500).all()


@pytest.mark.parametrize("line", ["m_colorWidth = 64\n", "m_depthShift = 2000\n"])
def test_an_info_txt_that_lacks_a_line_is_told(tmp_path: Path, line: str) -> None:
    write(tmp_path, "frame-{:06}.color.jpg", "frame-{:06}.depth.png")
    (tmp_path / "info.txt").write_text(SENS.replace(line, ""))
    with pytest.raises(ConfigError, match=r"info.txt: give m_colorWidth"):
        layout_of(tmp_path)


def test_pictures_of_depth_and_images_of_a_second_camera_are_left_out_and_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path, "left_color_{}.png", "left_depth_{}.png")
    write(tmp_path, "right_color_{}.png", "left_depth_vis_{}.png")
    found = layout_of(tmp_path)
    assert [entry.values[0] for entry in found.color] == [f"left_color_{i}.png" for i in range(FRAMES)]
    assert [entry.values[0] for entry in found.depth] == [f"left_depth_{i}.png" for i in range(FRAMES)]
    assert "4 named otherwise left out, such as left_depth_vis_" in caplog.text


def test_a_folder_of_depth_with_coloured_pictures_of_it_is_no_source(tmp_path: Path) -> None:
    write(tmp_path, "depth_color_{}.png", "depth_{}.png")
    assert not is_image_folder(tmp_path)
