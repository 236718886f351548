"""OpenLORIS' folders: TUM's lists under other names, a camera in sensors.yaml, and truth of the robot's base."""

from pathlib import Path

import numpy as np
import pytest
from test_damaged_layouts import FRAMES, images

from odom.frame import Camera
from sensors.folder_layouts import layout_of
from sensors.image_lists import pose_of

SENSORS = """%YAML:1.0
d400_color_optical_frame:
   sensor_type: camera
   width: 64
   height: 48
   model: pinhole
   intrinsics: !!opencv-matrix
      rows: 1
      cols: 4
      dt: d
      data: [ 60., 31.5, 61., 23.5 ]
   distortion_model: radial-tangential
   distortion_coefficients: !!opencv-matrix
      rows: 1
      cols: 5
      dt: d
      data: [ 0.1, 0., 0., 0., 0. ]
"""
MOUNTS = """%YAML:1.0
trans_matrix:
   -
      parent_frame: base_link
      child_frame: laser
      matrix: !!opencv-matrix
         rows: 4
         cols: 4
         dt: d
         data: [ 1., 0., 0., 0.2, 0., 1., 0., 0., 0., 0., 1., 0.1, 0., 0., 0., 1. ]
   -
      parent_frame: laser
      child_frame: d400_color_optical_frame
      matrix: !!opencv-matrix
         rows: 4
         cols: 4
         dt: d
         data: [ 0., 0., 1., 0.3, -1., 0., 0., 0., 0., -1., 0., 0.4, 0., 0., 0., 1. ]
"""
T_BASE_CAMERA = np.array([[0, 0, 1, 0.5], [-1, 0, 0, 0], [0, -1, 0, 0.5], [0, 0, 0, 1]])


def openloris(folder: Path) -> Path:
    images(folder, "color/{}.png", "aligned_depth/{}.png")
    for name in ("color", "aligned_depth"):
        (folder / f"{name}.txt").write_text("\n".join(f"100.{i} {name}/{i}.png" for i in range(FRAMES)))
    (folder / "groundtruth.txt").write_text("\n".join(f"100.{i} {i} 0 0 0 0 0 1" for i in range(FRAMES)))
    (folder / "sensors.yaml").write_text(SENSORS)
    (folder / "trans_matrix.yaml").write_text(MOUNTS)
    return folder


def test_images_camera_unit_and_the_cameras_poses_are_read(tmp_path: Path) -> None:
    found = layout_of(openloris(tmp_path))
    assert [entry.values[0] for entry in found.color] == [f"color/{i}.png" for i in range(FRAMES)]
    assert [entry.values[0] for entry in found.depth] == [f"aligned_depth/{i}.png" for i in range(FRAMES)]
    assert found.camera == Camera(64, 48, 60.0, 61.0, 31.5, 23.5, (0.1, 0.0, 0.0, 0.0, 0.0))
    assert found.depth_scale == 1000.0
    for i, entry in enumerate(found.truth):
        T_world_base = np.eye(4)
        T_world_base[0, 3] = i
        assert np.allclose(pose_of(entry), T_world_base @ T_BASE_CAMERA)
    assert len(found.truth) == FRAMES


@pytest.mark.parametrize("mounts", [None, "%YAML:1.0\n", MOUNTS.replace("base_link", "laser"), "x: [", "\x00"])
def test_truth_of_a_base_whose_camera_is_mounted_nobody_knows_how_is_told_and_left_aside(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, mounts: str | None
) -> None:
    openloris(tmp_path)
    (tmp_path / "trans_matrix.yaml").unlink() if mounts is None else (tmp_path / "trans_matrix.yaml").write_text(mounts)
    assert layout_of(tmp_path).truth == []
    assert "without truth" in caplog.text


@pytest.mark.parametrize(
    "sensors", [None, "x: 1\n", SENSORS.replace("60., ", ""), "x: [", SENSORS.replace("60.", "-60.")]
)
def test_a_camera_that_cannot_be_read_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, sensors: str | None
) -> None:
    openloris(tmp_path)
    (tmp_path / "sensors.yaml").unlink() if sensors is None else (tmp_path / "sensors.yaml").write_text(sensors)
    assert layout_of(tmp_path).camera is None
    assert ("sensors.yaml" in caplog.text) == (sensors is not None)


@pytest.mark.parametrize("mounts", ["trans_matrix: 5\n", "trans_matrix: [ 5 ]\n", "- 5\n"])
def test_mounts_of_another_form_are_told_and_left_aside(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, mounts: str
) -> None:
    (openloris(tmp_path) / "trans_matrix.yaml").write_text(f"%YAML:1.0\n---\n{mounts}")
    assert layout_of(tmp_path).truth == []
    assert "trans_matrix.yaml" in caplog.text
    assert "it goes on without truth" in caplog.text


def test_a_pose_that_is_none_is_left_for_the_source_to_count(tmp_path: Path) -> None:
    openloris(tmp_path)
    (tmp_path / "groundtruth.txt").write_text("100.0 0 0 0 0 0 0 0\n100.1 1 0 0 0 0 0 1")
    assert len(layout_of(tmp_path).truth) == 2
