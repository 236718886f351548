"""Intrinsics in files beside the images are read as editors and other systems write them, and refused by name."""

import json
from pathlib import Path

import pytest

from odom.errors import ConfigError
from odom.frame import Camera
from sensors.intrinsic_files import matrix_camera, open3d_camera, row_camera

SIZE = 64, 48
CAMERA = Camera(*SIZE, 60.0, 61.0, 31.5, 23.5)
MATRIX = "60 0 31.5 0\r\n# rows\r\n0 61 23.5 0\r\n\r\n0 0 1 0\r\n"
OPEN3D = json.dumps({"width": 64, "height": 48, "intrinsic_matrix": [60, 0, 0, 0, 61, 0, 31.5, 23.5, 1]})


def written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_bytes(text.encode())
    return folder / name


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_a_mark_of_the_bytes_order_is_no_part_of_the_numbers(tmp_path: Path, mark: str) -> None:
    assert matrix_camera(written(tmp_path, "intrinsic_color.txt", mark + MATRIX), SIZE) == CAMERA
    assert row_camera(written(tmp_path, "calibration.txt", f"{mark}60 61 31.5 23.5\n"), SIZE) == CAMERA
    assert open3d_camera(written(tmp_path, "intrinsic.json", mark + OPEN3D)) == CAMERA


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("text", ["", "# nothing\n", "60 0 31.5\n", "60 0\n0 61\n0 0\n", "hello", "\0"])
def test_what_is_no_matrix_is_refused_by_its_file_and_nothing_else_is_said(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match=r"intrinsic_color\.txt: give a matrix"):
        matrix_camera(written(tmp_path, "intrinsic_color.txt", text), SIZE)


def test_intrinsics_that_no_camera_has_are_refused_by_their_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"intrinsic_color\.txt: .*finite intrinsics"):
        matrix_camera(written(tmp_path, "intrinsic_color.txt", MATRIX.replace("60", "-60")), SIZE)
    with pytest.raises(ConfigError, match=r"intrinsic\.json: .*finite intrinsics"):
        open3d_camera(written(tmp_path, "intrinsic.json", OPEN3D.replace("60", "-60")))
