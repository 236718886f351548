"""Folders of other tools that are not read are refused by name, with what to convert; what is said to do is enough."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from refused import refusal
from test_damaged_layouts import FRAMES, images

from odom.errors import ConfigError
from sensors.catalogue import open_source
from sensors.folder_layouts import layout_of
from sensors.source import SourceOptions


def stray_scanner(folder: Path) -> None:
    images(folder, "rgb/{:06}.jpg", "depth/{:06}.png")
    for file in (folder / "rgb").iterdir():
        file.unlink()
    (folder / "rgb").rmdir()
    (folder / "rgb.mp4").write_bytes(b"")
    (folder / "odometry.csv").write_text("timestamp, frame, x, y, z, qx, qy, qz, qw\n")


def nyu_raw(folder: Path) -> None:
    images(folder, "r-1300000000.{:06}-17.ppm", "d-1300000000.{:06}-17.pgm")


def record3d(folder: Path) -> None:
    (folder / "rgbd").mkdir()
    (folder / "metadata").write_text("{}")
    for i in range(FRAMES):
        cv2.imwrite(str(folder / "rgbd" / f"{i}.jpg"), np.zeros((48, 64, 3), np.uint8))
        (folder / "rgbd" / f"{i}.depth").write_bytes(b"bvx2")


def tartan_air(folder: Path) -> None:
    images(folder, "image_left/{:06}_left.png", "depth_left/{:06}_left_depth.png")
    for file in (folder / "depth_left").iterdir():
        np.save(file.with_suffix(".npy"), np.ones((48, 64), np.float32))
        file.unlink()


@pytest.mark.parametrize(
    ("write", "names"),
    [
        (stray_scanner, ("StrayScanner", "rgb.mp4", "rgb/", "camera.yaml")),
        (nyu_raw, ("NYU Depth V2", "disparities", "rgb/", "depth/")),
        (record3d, ("Record3D", "LZFSE", "rgb/", "depth/")),
        (tartan_air, ("depth_left/", "numpy", "color/", "depth/")),
    ],
)
def test_a_layout_that_is_not_read_is_named_with_what_to_convert(
    tmp_path: Path, write: Callable[[Path], None], names: tuple[str, ...]
) -> None:
    write(tmp_path)
    with pytest.raises(ConfigError) as told:
        open_source(str(tmp_path), SourceOptions())
    assert str(told.value) == refusal("info", tmp_path)
    assert all(name in str(told.value) for name in names)
    assert "neither" not in str(told.value)


def test_a_record3d_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "walk.r3d").write_bytes(b"PK")
    with pytest.raises(ConfigError, match="Record3D"):
        open_source(str(tmp_path / "walk.r3d"), SourceOptions())


def test_depth_in_numpys_files_is_read_once_its_folders_are_called_as_is_said(tmp_path: Path) -> None:
    tartan_air(tmp_path)
    (tmp_path / "image_left").rename(tmp_path / "color")
    (tmp_path / "depth_left").rename(tmp_path / "depth")
    found = layout_of(tmp_path)
    assert [entry.stamp for entry in found.color] == [entry.stamp for entry in found.depth]
    assert len(found.color) == FRAMES
