"""Damaged or missing parts of folders of images are told, and change nothing of what is whole."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from refused import refusal

from sensors.folder_layouts import layout_of
from sensors.image_lists import pose_of, stamp_of_frame

FRAMES = 4


def images(folder: Path, color_name: str, depth_name: str) -> None:
    """Write images of one shade, whose names hold `{}` for the number of the frame."""
    for i in range(FRAMES):
        for name, image in ((color_name, np.full((48, 64, 3), 9 * i)), (depth_name, np.full((48, 64), 1500 + i))):
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


def test_info_of_a_folder_that_is_no_source_says_what_a_run_says(tmp_path: Path) -> None:
    for folder in (tmp_path / "empty", tmp_path / "above"):
        folder.mkdir()
    images(tmp_path / "above" / "walk", "rgb/{}.png", "depth/{}.png")
    for folder in (tmp_path / "empty", tmp_path / "above"):
        assert refusal("info", folder) == refusal("import", folder, tmp_path / "out.mcap")
    assert f"did you mean {tmp_path / 'above' / 'walk'}?" in refusal("info", tmp_path / "above")
