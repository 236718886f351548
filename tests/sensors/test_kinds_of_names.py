"""Images of several cameras in one folder: one camera's are taken, and which is told."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from sensors.folder_layouts import layout_of
from sensors.kinds_of_names import of_one_camera

FRAMES = 6


def named(pattern: str, count: int = FRAMES, folder: str = "color") -> list[Path]:
    return [Path(folder) / pattern.format(i) for i in range(count)]


@pytest.mark.parametrize("side", ["left", "right"])
def test_colour_is_of_the_camera_that_depth_is_named_after(side: str) -> None:
    sides = {name: named(f"{name}_{{:04}}.jpg") for name in ("left", "right")}
    depth = named(f"{side}_{{:04}}.png", folder="depth")
    assert of_one_camera([*sides["left"], *sides["right"]], depth) == (sides[side], depth)


def test_colour_and_depth_of_two_cameras_are_both_of_one() -> None:
    color = [*named("b_color_{}.jpg"), *named("a_color_{}.jpg")]
    depth = [*named("b_depth_{}.png", folder="depth"), *named("a_depth_{}.png", folder="depth")]
    taken = of_one_camera(color, depth)
    assert taken == (named("a_color_{}.jpg"), named("a_depth_{}.png", folder="depth"))


def test_a_few_strays_that_are_named_as_depth_is_are_not_colour() -> None:
    color, strays, depth = named("frame_{}.jpg", 20), named("{}.jpg", 3), named("{}.png", 20, "depth")
    assert of_one_camera([*color, *strays], depth) == (color, depth)


def test_whole_and_broken_seconds_are_of_one_camera() -> None:
    color = [Path("color") / f"{stamp}.png" for stamp in ("1700000000", "1700000000.5", "1700000001")]
    assert of_one_camera(color, color)[0] == color


@pytest.mark.parametrize("poses", [False, True], ids=["pair of folders", "ScanNet's"])
def test_images_of_two_cameras_in_one_folder_do_not_take_turns(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, poses: bool
) -> None:
    for folder in ("color", "depth", *(["pose"] if poses else [])):
        (tmp_path / folder).mkdir()
    for i in range(FRAMES):
        for delay_ns, side in enumerate(("left", "right")):
            name = f"{side}_17000000{i:02}.{4_000_000 * delay_ns:09}.png"
            cv2.imwrite(str(tmp_path / "color" / name), np.zeros((48, 64, 3), np.uint8))
        cv2.imwrite(str(tmp_path / "depth" / f"17000000{i:02}.000000000.png"), np.full((48, 64), 1000, np.uint16))
    layout = layout_of(tmp_path)
    assert [entry.values[0].rpartition("/")[2].partition("_")[0] for entry in layout.color] == ["left"] * FRAMES
    assert len(layout.depth) == FRAMES
    (told,) = [each.getMessage() for each in caplog.records if "named otherwise" in each.getMessage()]
    assert f"{FRAMES} named otherwise left out, such as right_" in told
