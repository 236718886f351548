"""A list of pairs alone is treated as TUM's two lists are: its camera, its truth, and what is damaged."""

from collections.abc import Callable
from pathlib import Path

import pytest
from test_damaged_layouts import FRAMES, images

from odom.errors import SourceError
from odom.frame import Camera
from sensors.default_camera import ICL_NUIM
from sensors.folder_layouts import layout_of
from sensors.image_lists import stamp_of_frame

CAMERA = Camera(64, 48, 60.0, 61.0, 31.5, 23.5)


def pairs(folder: Path, stamp: str = "100.{}") -> None:
    images(folder, "rgb/{}.png", "depth/{}.png")
    lines = [f"{stamp.format(i)} rgb/{i}.png {stamp.format(i)} depth/{i}.png" for i in range(FRAMES)]
    (folder / "associations.txt").write_text("\n".join(lines))


def two_lists(folder: Path) -> None:
    images(folder, "rgb/{}.png", "depth/{}.png")
    for name in ("rgb", "depth"):
        (folder / f"{name}.txt").write_text("\n".join(f"100.{i} {name}/{i}.png" for i in range(FRAMES)))


@pytest.mark.parametrize("write", [pairs, two_lists])
@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("calibration.txt", "60 61 31.5 23.5"),
        ("intrinsics.txt", "60 0 31.5\n0 61 23.5\n0 0 1"),
        ("intrinsic.json", '{"width": 64, "height": 48, "intrinsic_matrix": [60, 0, 0, 0, 61, 0, 31.5, 23.5, 1]}'),
    ],
)
def test_intrinsics_beside_a_list_are_its_cameras(
    tmp_path: Path, write: Callable[[Path], None], file: str, content: str
) -> None:
    write(tmp_path)
    (tmp_path / file).write_text(content)
    assert layout_of(tmp_path).camera == CAMERA


@pytest.mark.parametrize("write", [pairs, two_lists])
@pytest.mark.parametrize("damage", ["100.1 0 0 0\n", "x y\n100.1 z", "\ud800"])
def test_truth_beside_a_list_that_is_damaged_is_told_and_done_without(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    write: Callable[[Path], None],
    damage: str,
) -> None:
    write(tmp_path)
    (tmp_path / "groundtruth.txt").write_bytes(damage.encode("utf-8", "surrogatepass"))
    assert layout_of(tmp_path).truth == []
    assert "without truth" in caplog.text


def test_truth_in_seconds_beside_pairs_of_numbered_frames_keeps_its_stamps(tmp_path: Path) -> None:
    pairs(tmp_path, "{}")
    (tmp_path / "groundtruth.txt").write_text("\n".join(f"{i / 30:.6f} {i} 0 0 0 0 0 1" for i in range(FRAMES)))
    found = layout_of(tmp_path)
    assert [entry.stamp for entry in found.color] == [stamp_of_frame(i) for i in range(FRAMES)]
    assert [round(entry.stamp * 30 / 1e9, 3) for entry in found.truth] == list(range(FRAMES))


def test_a_matrix_of_icl_nuims_own_axes_leaves_its_published_camera(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pairs(tmp_path)
    images(tmp_path, "rgb/{}.png", "depth/{}.png", (640, 480))
    (tmp_path / "livingRoom0.gt.freiburg").write_text("100.1 0 0 0 0 0 0 1")
    (tmp_path / "intrinsics.txt").write_text("481.2 0 319.5\n0 -480 239.5\n0 0 1")
    assert layout_of(tmp_path).camera == ICL_NUIM
    assert "-480" in caplog.text


@pytest.mark.parametrize("write", [pairs, two_lists])
def test_icl_nuims_truth_and_camera_do_not_hang_on_which_list_names_the_images(
    tmp_path: Path, write: Callable[[Path], None]
) -> None:
    write(tmp_path)
    images(tmp_path, "rgb/{}.png", "depth/{}.png", (640, 480))
    (tmp_path / "livingRoom0.gt.freiburg").write_text("100.1 1 2 3 0 0 0 1")
    found = layout_of(tmp_path)
    assert found.camera == ICL_NUIM
    assert [entry.values[:3] for entry in found.truth] == [("1", "-2", "3")]


def test_which_of_a_pair_is_depth_is_told_by_its_own_folder_and_not_one_above(tmp_path: Path) -> None:
    folder = tmp_path / "depth_set"
    folder.mkdir()
    pairs(folder)
    lines = [f"100.{i} {folder}/rgb/{i}.png 100.{i} {folder}/depth/{i}.png" for i in range(FRAMES)]
    (folder / "associations.txt").write_text("\n".join(lines))
    found = layout_of(folder)
    assert [entry.values[0] for entry in found.color] == [f"{folder}/rgb/{i}.png" for i in range(FRAMES)]


@pytest.mark.parametrize(("color", "depth"), [("RGB/{}.png", "Depth_reg/{}.png"), ("rgb_{}.png", "depth_{}.png")])
def test_a_list_of_pairs_says_where_the_images_are(tmp_path: Path, color: str, depth: str) -> None:
    images(tmp_path, color, depth)
    lines = [f"100.{i} {color.format(i)} 100.{i} {depth.format(i)}" for i in range(FRAMES)]
    (tmp_path / "associations.txt").write_text("\n".join(lines))
    found = layout_of(tmp_path)
    assert found.name == "associations.txt"
    assert [entry.values for entry in found.color] == [(color.format(i),) for i in range(FRAMES)]
    assert [entry.values for entry in found.depth] == [(depth.format(i),) for i in range(FRAMES)]


def test_a_list_of_colour_alone_gives_way_to_one_of_pairs(tmp_path: Path) -> None:
    pairs(tmp_path)
    (tmp_path / "rgb.txt").write_text("100.0 rgb/0.png\n")
    assert layout_of(tmp_path).name == "associations.txt"


@pytest.mark.parametrize(("stamp", "name"), [("1305031102.{}", "1305031102.{}"), ("{}", "{}")])
def test_depth_without_a_list_has_the_stamps_of_its_names(tmp_path: Path, stamp: str, name: str) -> None:
    images(tmp_path, "rgb/{}.png", f"depth/{name}.png")
    (tmp_path / "rgb.txt").write_text("\n".join(f"{stamp.format(i)} rgb/{i}.png" for i in range(FRAMES)))
    found = layout_of(tmp_path)
    assert [entry.stamp for entry in found.depth] == [entry.stamp for entry in found.color]
    assert found.depth_scale == 5000.0


def test_without_depth_its_list_is_asked_for(tmp_path: Path) -> None:
    (tmp_path / "rgb.txt").write_text("100.0 rgb/0.png\n")
    with pytest.raises(SourceError, match=r"depth\.txt cannot be read"):
        layout_of(tmp_path)
