"""Depth images of folders in other forms than 16 bits of grey: numpy's files, and numbers with a point in metres."""

import logging
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from odom.cli.calibrate import calibrate
from odom.errors import SourceError
from odom.evaluation.diagnosis.recording import NOT_DEPTH, NOT_METRES, OTHER_FORMAT
from odom.wire import Topics
from odom.wire.codec import decode_depth
from sensors.catalogue import open_source
from sensors.folder_layouts import layout_of
from sensors.source import SourceOptions
from sensors.tum import open_tum

TOPICS = Topics()
FRAMES = 3
SHAPE = 48, 64


def metres(i: int) -> np.ndarray:
    image = np.full(SHAPE, 1.5 + 0.1 * i)
    image[0, :4] = 0.0, np.nan, np.inf, -1.0
    image[1, 0] = 66.0
    return image


def millimetres(i: int) -> np.ndarray:
    image = np.full(SHAPE, 1500 + 100 * i)
    image[0, :4] = image[1, 0] = 0
    return image


def write(folder: Path, depth_name: str, depth: Callable[[int], np.ndarray]) -> None:
    for i in range(FRAMES):
        for name, image in (("rgb/{}.png", np.full((*SHAPE, 3), 100, np.uint8)), (depth_name, depth(i))):
            file = folder / name.format(i)
            file.parent.mkdir(parents=True, exist_ok=True)
            if file.suffix == ".npy":
                np.save(file, image)
            else:
                cv2.imwrite(str(file), image)


def depth_of(folder: Path, camera: Path | None = None) -> list[np.ndarray]:
    messages = open_source(str(folder), SourceOptions(topics=TOPICS, camera=camera)).messages()
    return [decode_depth(message) for message in messages if message.topic == TOPICS.depth]


@pytest.mark.parametrize("camera_yaml", ["", "depth_scale: 5000\n"])
@pytest.mark.parametrize(
    ("name", "stored"),
    [
        ("depth/{}.npy", lambda i: metres(i).astype(np.float32)),
        ("depth/{}.npy", lambda i: metres(i)[..., None]),
        ("depth/{}.npy", lambda i: np.asfortranarray(metres(i).astype(">f4"))),
        ("depth/{}.tiff", lambda i: metres(i).astype(np.float32)),
        ("depth/{}.tif", metres),
    ],
)
def test_numbers_with_a_point_are_metres(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
    name: str,
    stored: Callable[[int], np.ndarray],
    camera_yaml: str,
) -> None:
    caplog.set_level(logging.INFO)
    write(tmp_path, name, stored)
    if camera_yaml:
        (tmp_path / "camera.yaml").write_text(camera_yaml)
    found = depth_of(tmp_path)
    assert len(found) == FRAMES
    assert all((mm == millimetres(i)).all() for i, mm in enumerate(found))
    assert caplog.text.count("numbers with a point: they are taken for metres") == 1
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("dtype", [np.uint16, np.int32, np.int64])
def test_whole_numbers_in_numpys_files_are_in_the_unit_of_the_folder(tmp_path: Path, dtype: type) -> None:
    write(tmp_path, "depth/{}.npy", lambda i: millimetres(i).astype(dtype))
    assert all((mm == millimetres(i)).all() for i, mm in enumerate(depth_of(tmp_path)))
    (tmp_path / "camera.yaml").write_text("depth_scale: 500\n")
    assert all((mm == 2 * millimetres(i)).all() for i, mm in enumerate(depth_of(tmp_path)))


def test_lists_may_name_numpys_files(tmp_path: Path) -> None:
    write(tmp_path, "depth/{}.npy", metres)
    for name, suffix in (("rgb", "png"), ("depth", "npy")):
        (tmp_path / f"{name}.txt").write_text("".join(f"{i / 30:.6f} {name}/{i}.{suffix}\n" for i in range(FRAMES)))
    assert all((mm == millimetres(i)).all() for i, mm in enumerate(depth_of(tmp_path)))


def test_metres_and_pictures_of_another_size_are_of_another_camera(tmp_path: Path) -> None:
    """Depth's size is known of numpy's files too: half of colour's is brought to colour's."""
    write(tmp_path, "depth/{}.npy", lambda i: np.full((24, 32), 1.5))
    assert {mm.shape for mm in depth_of(tmp_path)} == {SHAPE}


@pytest.mark.parametrize(
    ("name", "stored", "why", "said"),
    [
        ("depth/{}.npy", lambda i: 1000.0 * metres(i), NOT_METRES, "half of it is beyond 65.5 m"),
        ("depth/{}.tif", lambda i: (1000 * metres(i)).astype(np.float32), NOT_METRES, "half of it is beyond 65.5 m"),
        ("depth/{}.npy", lambda i: np.full((*SHAPE, 3), 1.5), NOT_DEPTH, "shape (48, 64, 3)"),
        ("depth/{}.npy", lambda i: np.full(SHAPE, 100, np.uint8), NOT_DEPTH, "type uint8"),
        ("depth/{}.npy", lambda i: np.full(SHAPE, "far"), "damaged file", "of type <U3"),
    ],
)
def test_what_holds_no_distances_in_a_known_unit_is_left_out_by_its_reason(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    name: str,
    stored: Callable[[int], np.ndarray],
    why: str,
    said: str,
) -> None:
    write(tmp_path, name, stored)
    source = open_tum(tmp_path, SourceOptions(topics=TOPICS))
    assert sum(message.topic == TOPICS.depth for message in source.messages()) == 0
    assert source.refused == {("depth", why): FRAMES}
    assert said in caplog.text


@pytest.mark.parametrize("cut", [4, 40, 200, 2000])
@pytest.mark.parametrize("suffix", ["npy", "tiff"])
def test_a_file_that_is_cut_is_damaged_and_nothing_is_said_beside_the_log(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], suffix: str, cut: int
) -> None:
    write(tmp_path, f"depth/{{}}.{suffix}", lambda i: metres(i).astype(np.float32))
    file = tmp_path / "depth" / f"1.{suffix}"
    file.write_bytes(file.read_bytes()[:cut])
    source = open_tum(tmp_path, SourceOptions(topics=TOPICS))
    assert sum(message.topic == TOPICS.depth for message in source.messages()) == FRAMES - 1
    assert sum(source.refused.values()) == 1
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", ["depth/{}.exr", "depth/{}.npz"])
def test_depth_of_a_format_that_is_not_read_is_told_and_no_reason_to_call_the_folder_none(
    tmp_path: Path, name: str
) -> None:
    write(tmp_path, "depth/{}.npy", metres)
    for i in range(FRAMES):
        (tmp_path / f"depth/{i}.npy").unlink()
        (tmp_path / name.format(i)).write_bytes(b"v/1\x01\x02\0\0\0")
    source = open_tum(tmp_path, SourceOptions(topics=TOPICS))
    assert list(source.messages())
    assert source.refused == {("depth", OTHER_FORMAT): FRAMES}


@pytest.mark.parametrize(("stream", "folder"), [("colour", "rgb"), ("depth", "depth")])
def test_a_calibration_ends_with_the_reason_where_no_image_can_be_used(
    tmp_path: Path, stream: str, folder: str
) -> None:
    """It asked for a calibration file, whatever was wrong with the images."""
    write(tmp_path, "depth/{}.png", lambda i: millimetres(i).astype(np.uint16))
    for name in ("rgb", "depth"):
        (tmp_path / f"{name}.txt").write_text("".join(f"{i / 30:.6f} {name}/{i}.png\n" for i in range(FRAMES)))
    for file in (tmp_path / folder).iterdir():
        file.unlink()
    said = rf"none of its {stream} images can be used, 3 of them: no such file; the list names files that are not there"
    with pytest.raises(SourceError, match=said):
        calibrate([str(tmp_path)], out=tmp_path / "camera-found.yaml")


def test_colour_in_numpys_files_is_of_a_format_that_is_not_read(tmp_path: Path) -> None:
    write(tmp_path, "depth/{}.npy", metres)
    for i in range(FRAMES):
        (tmp_path / f"rgb/{i}.png").unlink()
        np.save(tmp_path / f"rgb/{i}.npy", np.zeros((*SHAPE, 3), np.uint8))
    source = open_tum(tmp_path, SourceOptions(topics=TOPICS))
    assert list(source.messages())
    assert source.refused == {("colour", OTHER_FORMAT): FRAMES}


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int16, np.int32])
def test_colour_of_numbers_that_are_no_shades_is_left_out_alone(tmp_path: Path, dtype: type) -> None:
    write(tmp_path, "depth/{}.npy", metres)
    cv2.imwrite(str(tmp_path / "rgb/1.tiff"), np.zeros((*SHAPE, 3), dtype))
    (tmp_path / "rgb/1.png").unlink()
    source = open_tum(tmp_path, SourceOptions(topics=TOPICS))
    assert sum(message.topic in TOPICS.color_keys for message in source.messages()) == FRAMES - 1
    assert source.refused == {("colour", OTHER_FORMAT): 1}


def test_pictures_beside_numpys_files_of_the_same_names_are_taken(tmp_path: Path) -> None:
    write(tmp_path, "depth/{}.npy", metres)
    write(tmp_path, "depth/{}.png", lambda i: millimetres(i).astype(np.uint16))
    assert [entry.values[0] for entry in layout_of(tmp_path).depth] == [f"depth/{i}.png" for i in range(FRAMES)]
