"""Stamps of a device's own clock, in a fraction of a second that their digits do not tell, are told by their steps."""

from pathlib import Path

import pytest

from odom.errors import SourceError
from sensors.image_lists import read_list
from sensors.image_names import by_stamp, images_in

CLOCKS = [
    ("milliseconds", 0, 33),
    ("milliseconds", 86_400_123, 33),
    ("microseconds", 86_400_123, 33_333),
    ("nanoseconds", 512_520_982_837, 33_333_333),
]


@pytest.mark.parametrize(("unit", "zero", "step"), CLOCKS)
def test_a_list_says_which_unit_its_steps_suggest(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, unit: str, zero: int, step: int
) -> None:
    file = tmp_path / "rgb.txt"
    file.write_text("".join(f"{zero + i * step} rgb/{i}.png\n" for i in range(5)))
    read_list(file, 1)
    assert f"rgb.txt: its stamps step by {step}: if these are {unit}, write seconds there" in caplog.text


@pytest.mark.parametrize(("unit", "zero", "step"), CLOCKS)
def test_names_say_which_unit_their_steps_suggest(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, unit: str, zero: int, step: int
) -> None:
    for i in range(5):
        (tmp_path / f"{zero + i * step}.png").touch()
    by_stamp(tmp_path, images_in(tmp_path))
    assert f"step by {step}: if these are {unit}, list the images with stamps in seconds in rgb.txt" in caplog.text


@pytest.mark.parametrize(
    "stamps",
    [
        ["1", "2", "3", "4"],
        ["1305031102.1", "1305031112.1", "1305031122.1"],
        ["1305031102175", "1305031102208", "1305031102241"],
        ["1305031102175000000", "1305031102208000000", "1305031102241000000"],
        ["7", "40"],
    ],
)
def test_stamps_that_are_what_they_are_taken_for_are_not_doubted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, stamps: list[str]
) -> None:
    file = tmp_path / "rgb.txt"
    file.write_text("".join(f"{stamp} rgb/0.png\n" for stamp in stamps))
    read_list(file, 1)
    assert not caplog.records


def test_a_stamp_too_late_for_a_recording_is_refused_by_file_and_line(tmp_path: Path) -> None:
    file = tmp_path / "rgb.txt"
    file.write_text("# colour\n5000000000 rgb/0.png\n5033333333 rgb/1.png\n")
    with pytest.raises(SourceError, match=r"rgb\.txt:2: 5000000000 .* divide nanoseconds by 1000000000"):
        read_list(file, 1)
