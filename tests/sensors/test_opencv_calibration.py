"""Calibrations as OpenCV's programs and ORB-SLAM keep them give the camera that they describe."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from odom.errors import ConfigError
from odom.frame import Camera
from sensors.calibration_file import TUM_DEPTH_SCALE, load_calibration
from sensors.depth_registration import load_depth_registration

LENS = (0.2624, -0.9531, -0.0054, 0.0026, 1.1633)
CAMERA = Camera(640, 480, 517.306408, 516.469215, 318.64304, 255.313989, LENS)
ORB_SLAM2 = """%YAML:1.0

#--------------------------------------------------------------------------------------------
# Camera Parameters. Adjust them!
#--------------------------------------------------------------------------------------------
Camera.fx: 517.306408
Camera.fy: 516.469215
Camera.cx: 318.643040
Camera.cy: 255.313989

Camera.k1: 0.2624
Camera.k2: -0.9531
Camera.p1: -0.0054
Camera.p2: 0.0026
Camera.k3: 1.1633

Camera.width: 640
Camera.height: 480
Camera.fps: 30.0
Camera.RGB: 1
DepthMapFactor: 1000.0
ORBextractor.nFeatures: 1000
"""
ORB_SLAM3 = (
    ORB_SLAM2.replace("Camera.", "Camera1.")
    .replace("Camera1.width", "Camera.width")
    .replace("Camera1.height", "Camera.height")
    .replace("# Camera Par", 'File.version: "1.0"\nCamera.type: "PinHole"\n# Camera Par')
    .replace("DepthMapFactor", "RGBD.DepthMapFactor")
)


def read(folder: Path, text: str, scale: float = TUM_DEPTH_SCALE) -> tuple[Camera, float]:
    file = folder / "camera.yaml"
    file.write_text(text)
    found = load_calibration(file, scale)
    assert load_depth_registration(file, found.camera) is None
    return found.camera, found.depth_scale


def written_by_opencv(folder: Path, size: tuple[str, str], matrix: str, lens: str) -> str:
    file = folder / "written.yaml"
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Sat Nov 28 10:00:00 2026")
    storage.write(size[0], 640)
    storage.write(size[1], 480)
    storage.write(matrix, CAMERA.matrix)
    storage.write(lens, np.array([LENS]).T)
    storage.write("avg_reprojection_error", 0.21)
    storage.release()
    return file.read_text()


@pytest.mark.parametrize("text", [ORB_SLAM2, ORB_SLAM3, ORB_SLAM2.replace("%YAML:1.0\n", "")], ids=["2", "3", "bare"])
def test_the_settings_of_orb_slam_are_a_calibration(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, text) == (CAMERA, 1000.0)
    assert read(tmp_path, text.replace("1000.0\n", "1.0\n"), 5000.0) == (CAMERA, 5000.0)


@pytest.mark.parametrize(
    "names",
    [
        (("image_width", "image_height"), "camera_matrix", "distortion_coefficients"),
        (("image_Width", "image_Height"), "Camera_Matrix", "Distortion_Coefficients"),
        (("width", "height"), "K", "D"),
    ],
)
def test_what_opencv_writes_is_a_calibration(tmp_path: Path, names: tuple[tuple[str, str], str, str]) -> None:
    text = written_by_opencv(tmp_path, *names)
    assert "!!opencv-matrix" in text
    assert read(tmp_path, text) == (CAMERA, TUM_DEPTH_SCALE)
    assert read(tmp_path, text + "depth_scale: 1000\n")[1] == 1000.0


RTABMAP = """%YAML:1.0
---
camera_name: "x"
image_width: 640
image_height: 480
camera_matrix:
   rows: 3
   cols: 3
   data: [ 517.306408, 0., 318.64304, 0., 516.469215, 255.313989, 0.,
       0., 1. ]
distortion_coefficients:
   rows: 1
   cols: 5
   data: [ 0.2624, -0.9531, -0.0054, 0.0026, 1.1633 ]
distortion_model: plumb_bob
"""


NO_LIST = "%YAML:1.0\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   data: 5\n"


def test_ros_keys_in_opencvs_yaml_as_rtabmap_writes_them_are_a_calibration(tmp_path: Path) -> None:
    assert read(tmp_path, RTABMAP) == (CAMERA, TUM_DEPTH_SCALE)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (ORB_SLAM2.replace("Camera.fy: 516.469215\n", ""), r"camera.yaml lacks a camera_matrix.*fx, fy"),
        (ORB_SLAM2.replace("Camera.width: 640\n", ""), r"lacks the images' width \(image_width"),
        (ORB_SLAM3.replace("PinHole", "KannalaBrandt8"), "KannalaBrandt8 is not supported"),
        (ORB_SLAM2.replace("517.306408", "none"), "camera_matrix"),
        ("%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: [", "cannot be read as OpenCV's YAML"),
        ("%YAML:1.0\n", "lacks a camera_matrix"),
        (RTABMAP.replace("0., 1. ]", "0. ]"), "camera_matrix is no matrix of as many numbers as its rows and cols"),
        (RTABMAP.replace("cols: 3", "cols: foo"), "camera_matrix is no matrix"),
        (NO_LIST, "camera_matrix is no matrix"),
        ("%YAML:1.0\n---\n- 1\n", "is a list"),
        (RTABMAP.replace("s: 3", "s: -3"), "camera_matrix is no matrix"),
        (RTABMAP.replace("0.2624", "none"), "distortion_coefficients is no matrix"),
        (RTABMAP.replace("plumb_bob", "equidistant"), "distortion model 'equidistant'"),
    ],
)
def test_what_such_a_file_lacks_is_named(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("matrix", "says"),
    [
        (
            "517.3, 0, 0, 0, 516.5, 0, 318.6, 255.3, 1",
            "last row 318.6 255.3 1, not 0 0 1: it is written column by column.*give fx 0 cx",
        ),
        ("258.65, 0, 159.3, 0, 258.25, 127.65, 0, 0, 0.5", "last row 0 0 0.5, not 0 0 1.*divide all nine values"),
        ("517.3, 0, 318.6, 0, 516.5, 255.3, 0, 1, 0", "last row 0 1 0, not 0 0 1.*give fx 0 cx, 0 fy cy, 0 0 1"),
    ],
)
def test_a_matrix_whose_last_row_is_another_is_refused_with_what_to_write(
    tmp_path: Path, matrix: str, says: str
) -> None:
    with pytest.raises(ConfigError, match=f"camera.yaml: camera_matrix has the {says}"):
        read(tmp_path, f"image_width: 640\nimage_height: 480\ncamera_matrix: {{data: [{matrix}]}}\n")
