"""Damaged or missing parts of folders of images are told, and change nothing of what is whole."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from refused import refusal

from odom.errors import ConfigError
from odom.frame import Camera
from sensors.folder_layouts import layout_of
from sensors.image_lists import pose_of, stamp_of_frame

FRAMES = 4


def images(folder: Path, color_name: str, depth_name: str, size: tuple[int, int] = (64, 48)) -> None:
    """Write images of one shade, whose names hold `{}` for the number of the frame."""
    shape = size[::-1]
    for i in range(FRAMES):
        for name, image in ((color_name, np.full((*shape, 3), 9 * i)), (depth_name, np.full(shape, 1500 + i))):
            file = folder / name.format(i)
            file.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(file), image.astype(np.uint8 if image.ndim == 3 else np.uint16))


def replica_line(i: int) -> str:
    T = np.eye(4)
    T[0, 3] = i
    return " ".join(map(str, T.ravel().tolist()))


@pytest.mark.parametrize("damage", ["", "# not a pose", "1 0 0", " ".join(["x"] * 16), "1e400 " * 16])
def test_a_line_of_replicas_truth_that_is_no_pose_shifts_no_other(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, damage: str
) -> None:
    images(tmp_path, "results/frame{:06}.png", "results/depth{:06}.png")
    lines = [replica_line(i) for i in range(FRAMES)]
    counts = damage and not damage.startswith("#")
    lines[1:2] = [damage] if counts else [damage, lines[1]]
    (tmp_path / "traj.txt").write_text("\n".join(lines))
    left = [i for i in range(FRAMES) if i != 1 or not counts]
    found = layout_of(tmp_path).truth
    assert [(entry.stamp, pose_of(entry)[0, 3]) for entry in found] == [(stamp_of_frame(i), i) for i in left]
    told = [record for record in caplog.records if "traj.txt" in record.getMessage()]
    assert len(told) == bool(counts)
    if counts:
        assert "1 of its 4 poses" in told[0].getMessage()
        assert "line 2" in told[0].getMessage()


def test_replicas_truth_that_cannot_be_read_is_told_and_done_without(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    images(tmp_path, "results/frame{:06}.png", "results/depth{:06}.png")
    (tmp_path / "traj.txt").write_bytes(b"\xff\xfe\x00")
    assert layout_of(tmp_path).truth == []
    assert "traj.txt cannot be read" in caplog.text


@pytest.mark.parametrize("scale", ["0", "-1", "NaN", "1e300", "1e-9"])
def test_a_depth_scale_of_replica_that_no_depth_has_is_refused(tmp_path: Path, scale: str) -> None:
    images(tmp_path, "results/frame{:06}.png", "results/depth{:06}.png")
    camera = f'{{"w": 64, "h": 48, "fx": 60, "fy": 60, "cx": 32, "cy": 24, "scale": {scale}}}'
    (tmp_path / "cam_params.json").write_text(f'{{"camera": {camera}}}')
    with pytest.raises(ConfigError, match=r"cam_params\.json.*units a metre"):
        layout_of(tmp_path)


def test_info_of_a_folder_that_is_no_source_says_what_a_run_says(tmp_path: Path) -> None:
    for folder in (tmp_path / "empty", tmp_path / "above"):
        folder.mkdir()
    images(tmp_path / "above" / "walk", "rgb/{}.png", "depth/{}.png")
    for folder in (tmp_path / "empty", tmp_path / "above"):
        assert refusal("info", folder) == refusal("import", folder, tmp_path / "out.mcap")
    assert f"did you mean {tmp_path / 'above' / 'walk'}?" in refusal("info", tmp_path / "above")


def rtabmap(folder: Path, focal: list[float]) -> list[Path]:
    """Write what rtabmap exports: images named by stamps, and for each a calibration in ROS's keys."""
    images(folder, "rgb/156000000{}.500000.jpg", "depth/156000000{}.500000.png")
    (folder / "calib").mkdir()
    files = [folder / f"calib/156000000{i}.500000.yaml" for i in range(FRAMES)]
    for i, (file, fx) in enumerate(zip(files, focal, strict=True)):
        file.write_text(
            f'%YAML:1.0\n---\ncamera_name: "{i}"\nimage_width: 64\nimage_height: 48\ncamera_matrix:\n   rows: 3\n'
            f"   cols: 3\n   data: [ {fx}, 0., 31.5, 0., 61., 23.5, 0., 0., 1. ]\ndistortion_coefficients:\n"
            "   rows: 1\n   cols: 5\n   data: [ 0., 0., 0., 0., 0. ]\ndistortion_model: plumb_bob\n"
        )
    return files


def test_the_calibration_that_rtabmap_exports_for_each_image_is_read(tmp_path: Path) -> None:
    rtabmap(tmp_path, [60.0] * FRAMES)
    assert layout_of(tmp_path).camera == Camera(64, 48, 60.0, 61.0, 31.5, 23.5)


@pytest.mark.parametrize("damaged", [False, True])
def test_calibrations_of_the_images_that_are_not_one_are_told_with_the_option_for_the_first(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, damaged: bool
) -> None:
    files = rtabmap(tmp_path, [60.0, 60.0, 60.0 if damaged else 61.0, 60.0])
    if damaged:
        files[2].write_bytes(b"%YAML:1.0\n---\ncamera_matrix: \xff")
    assert layout_of(tmp_path).camera is None
    assert f"--camera {files[0]}" in caplog.text
    assert str(files[2]) in caplog.text or damaged


@pytest.mark.parametrize("name", ["{}0", "1{}"])
def test_as_many_true_poses_as_images_of_replica_are_theirs_whatever_their_numbers(tmp_path: Path, name: str) -> None:
    images(tmp_path, f"results/frame{name}.png", f"results/depth{name}.png")
    (tmp_path / "traj.txt").write_text("\n".join(replica_line(i) if i != 1 else "lost" for i in range(FRAMES)))
    found = layout_of(tmp_path)
    stamps = [entry.stamp for entry in found.color]
    assert [(entry.stamp, pose_of(entry)[0, 3]) for entry in found.truth] == [(stamps[i], i) for i in (0, 2, 3)]


def test_a_true_pose_of_each_frame_is_found_by_the_numbers_of_the_images_that_were_kept(tmp_path: Path) -> None:
    images(tmp_path, "results/frame{}0.png", "results/depth{}0.png")
    (tmp_path / "traj.txt").write_text("\n".join(replica_line(i) for i in range(10 * FRAMES)))
    found = layout_of(tmp_path)
    at = {entry.stamp: pose_of(entry)[0, 3] for entry in found.truth}
    assert [at[entry.stamp] for entry in found.color] == [0, 10, 20, 30]


@pytest.mark.parametrize(
    "names", [("color/{}.png", "depth/{}.png", "pose/{}.txt"), ("{}.color.png", "{}.depth.png", "{}.pose.txt")]
)
def test_files_of_true_poses_that_are_no_matrix_are_counted_and_told_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, names: tuple[str, str, str]
) -> None:
    images(tmp_path, *names[:2])
    contents = ["1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "1 0 0 0\n0 1 0 0\n0 0 1 0\n", "no pose", "-inf " * 16]
    for i, content in enumerate(contents):
        file = tmp_path / names[2].format(i)
        file.parent.mkdir(exist_ok=True)
        file.write_text(content)
    assert [entry.stamp for entry in layout_of(tmp_path).truth] == [stamp_of_frame(0)]
    told = [record.getMessage() for record in caplog.records if "true poses" in record.getMessage()]
    assert len(told) == 1
    assert "2 of 4" in told[0]
    assert str(tmp_path / names[2].format(1)) in told[0]
