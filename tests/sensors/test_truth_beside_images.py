"""A trajectory in TUM's format beside images without lists is their truth where both have stamps of one kind."""

from pathlib import Path

import pytest
from test_damaged_layouts import FRAMES, images

from odom import read_recording
from sensors.folder_layouts import layout_of
from sensors.image_lists import stamp_of_frame

STAMPED = "156000000{}.500000"
FOLDERS = ("rgb/{}.png", "depth/{}.png")


def truth(folder: Path, stamp: str) -> None:
    (folder / "groundtruth.txt").write_text("\n".join(f"{stamp.format(i)} {i} 0 0 0 0 0 1" for i in range(FRAMES)))


@pytest.mark.parametrize("names", [FOLDERS, ("{}.color.png", "{}.depth.png"), ("color/{}.png", "depth/{}.png")])
@pytest.mark.parametrize("stamp", [STAMPED, "{}"])
def test_the_trajectory_is_the_truth_of_images_of_its_kind_of_stamps(
    tmp_path: Path, names: tuple[str, str], stamp: str
) -> None:
    images(tmp_path, *(name.format(stamp) for name in names))
    if names[0].startswith("color/"):
        (tmp_path / "intrinsic").mkdir()
    truth(tmp_path, stamp)
    found = layout_of(tmp_path)
    assert [entry.stamp for entry in found.truth] == [entry.stamp for entry in found.color]
    assert [entry.values[0] for entry in found.truth] == [str(i) for i in range(FRAMES)]


def test_a_trajectory_in_seconds_beside_numbered_images_is_told_and_left_aside(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    images(tmp_path, *FOLDERS)
    truth(tmp_path, "0.0{}")
    found = layout_of(tmp_path)
    assert found.truth == []
    assert [entry.stamp for entry in found.color] == [stamp_of_frame(i) for i in range(FRAMES)]
    assert "rgb.txt" in caplog.text
    assert "without truth" in caplog.text


def test_a_damaged_trajectory_beside_images_is_told_and_done_without(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    images(tmp_path, *(name.format(STAMPED) for name in FOLDERS))
    (tmp_path / "groundtruth.txt").write_text("1560000000.5 0 0")
    assert layout_of(tmp_path).truth == []
    assert "without truth" in caplog.text


@pytest.mark.parametrize("stamp", ["156000000{}.500000", "{}"])
@pytest.mark.parametrize("lists", ["rgb.txt", "associations.txt"])
def test_truth_in_python_is_that_of_the_frames_without_poses_that_are_none(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, lists: str, stamp: str
) -> None:
    images(tmp_path, *FOLDERS)
    stamps = [stamp.format(i) for i in range(FRAMES)]
    if lists == "rgb.txt":
        for stream in ("rgb", "depth"):
            lines = (f"{at} {stream}/{i}.png" for i, at in enumerate(stamps))
            (tmp_path / f"{stream}.txt").write_text("\n".join(lines))
    else:
        lines = (f"{at} rgb/{i}.png {at} depth/{i}.png" for i, at in enumerate(stamps))
        (tmp_path / lists).write_text("\n".join(lines))
    poses = [f"{at} {i} 0 0 0 0 0 1" for i, at in enumerate(stamps)]
    lost = f"{stamps[1]} nan nan nan nan nan nan nan"
    (tmp_path / "groundtruth.txt").write_text("\n".join([*poses[:1], lost, *poses[2:], poses[2]]))
    recording = read_recording(tmp_path)
    frames = [frame.stamp for frame in recording]
    assert recording.truth()["camera"].stamps.tolist() == [frames[0], *frames[2:]]
    assert "1 true poses are left out" in caplog.text
