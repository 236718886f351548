"""A run of which no frame is tracked fails, and says in one line why and what to do."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from painted_wall import CAMERA, SIZE, write_wall

from odom.service import failed_tracking
from odom.service.failed_tracking import why_not_tracked, why_poor
from sensors.catalogue import open_source
from sensors.source import Source, SourceOptions

Start = Callable[..., "subprocess.Popen[str]"]
WIDTH, HEIGHT = SIZE


def replace_all(folder: Path, image: np.ndarray) -> None:
    for file in folder.iterdir():
        cv2.imwrite(str(file), image)


def swap(folder: Path) -> None:
    (folder / "rgb.txt").rename(folder / "was")
    (folder / "depth.txt").rename(folder / "rgb.txt")
    (folder / "was").rename(folder / "depth.txt")


SPOILT: dict[str, tuple[Callable[[Path], object], str]] = {
    "black depth": (
        lambda folder: replace_all(folder / "depth", np.zeros((HEIGHT, WIDTH), np.uint16)),
        "valid depth: no pixel has depth: the depth stream is empty",
    ),
    "depth of 8 bits": (
        lambda folder: replace_all(folder / "depth", np.full((HEIGHT, WIDTH), 80, np.uint8)),
        "export depth as 16-bit PNG",
    ),
    "white images": (
        lambda folder: replace_all(folder / "rgb", np.full((HEIGHT, WIDTH, 3), 255, np.uint8)),
        "set the exposure",
    ),
    "swapped lists": (swap, "rgb.txt and depth.txt are swapped"),
}


@pytest.fixture
def wall(tmp_path: Path) -> Path:
    folder = write_wall(tmp_path / "wall", frames=30)
    (folder / "camera.yaml").write_text(CAMERA)
    return folder


def test_a_start_behind_the_end_is_told_and_no_cable_blamed(wall: Path) -> None:
    def open_again() -> Source:
        return open_source(str(wall), SourceOptions(start=1000.0))

    nothing = {"frames": 0, "tracked": 0, "colour": {"given": 0, "used": 0, "refused": {}}}
    assert "--start 1000 is behind the end" in why_not_tracked(nothing, str(wall), open_again, start=1000.0)


@pytest.mark.parametrize("fault", ["black depth", "white images", "depth of 8 bits"])
def test_the_reason_and_the_remedy_are_found_in_the_source(wall: Path, fault: str) -> None:
    spoil, remedy = SPOILT[fault]
    spoil(wall)
    assert remedy in why_not_tracked({}, str(wall), lambda: open_source(str(wall), SourceOptions()))


def test_without_truth_a_wrong_unit_of_depth_is_told_though_all_frames_are_tracked(wall: Path) -> None:
    def told() -> str | None:
        return why_poor({"completeness": 1.0}, wall, lambda: open_source(str(wall), SourceOptions()))

    assert told() is None
    (wall / "camera.yaml").write_text(CAMERA.replace("depth_scale: 5000", "depth_scale: 100000"))
    assert "half of the depth is within" in (told() or "")


def test_where_the_source_shows_no_fault_the_counts_of_a_poor_run_say_what_happened(
    wall: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(failed_tracking, "_main_fault", lambda *_, **__: None)
    lost = {"no known place recognised": 70, "too little to see": 10}
    report = {
        "completeness": 0.3, "tracked": 40, "frames": 120, "lost_for": lost, "ate_m": None,
        "colour": {"given": 130, "used": 120, "refused": {"stamp far from all others": 10}},
    }  # fmt: skip
    told = why_poor(report, wall, lambda: open_source(str(wall), SourceOptions())) or ""
    assert told.startswith("only 40 of 130 colour images were tracked; the others: 70 no known place recognised")
    assert "10 too little to see" in told
    assert "10 stamp far from all others" in told
    assert "Most often, no known place recognised: the camera was lost" in told
    assert "move slower" in told


@pytest.mark.parametrize("fault", ["black depth", "swapped lists"])
def test_a_run_that_tracks_nothing_fails_with_the_reason_and_the_remedy(
    odom: Start, wall: Path, tmp_path: Path, fault: str
) -> None:
    """Of frames that cannot be tracked, and without any."""
    folder, out = wall, tmp_path / "out"
    spoil, remedy = SPOILT[fault]
    spoil(folder)
    run = odom("run", folder, "--headless", "--out", out)
    words, _ = run.communicate(timeout=120)
    assert run.returncode == 1, words
    last = words.splitlines()[-1]
    assert last.startswith("odom: no"), words
    assert remedy in last
    assert "0 of 30 frames tracked" in words or "no frame was processed" in last
    assert "Traceback" not in words


def test_of_a_source_that_cannot_be_opened_again_the_odometrys_reasons_are_told() -> None:
    said = why_not_tracked({"lost_for": {"no depth": 50, "too little to see": 10}}, "kinect", None)
    assert said == "50 frames: no depth; `odom doctor kinect` looks for the cause"
