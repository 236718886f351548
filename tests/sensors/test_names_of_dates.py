"""Images named by date and time are played in the order of that time."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from sensors.image_names import by_stamp, images_in

LAST_OF_A_MINUTE = int(datetime(2011, 5, 10, 12, 38, 59, tzinfo=UTC).timestamp())


def stamps_of(folder: Path, names: list[str]) -> dict[str, int]:
    for name in names:
        (folder / f"{name}.png").touch()
    return {Path(entry.values[0]).stem: entry.stamp for entry in by_stamp(folder, images_in(folder))}


@pytest.mark.parametrize(
    ("before", "after", "part_ns"),
    [
        ("2011-05-10 12:38:59.175304", "2011-05-10 12:39:00.143304", 175_304_000),
        ("2011-05-10T12-38-59.175304", "2011-05-10T12-39-00.143304", 175_304_000),
        ("2011-05-10-12-38-59-175304", "2011-05-10-12-39-00-143304", 175_304_000),
        ("20110510_123859_175304", "20110510_123900_143304", 175_304_000),
        ("20110510123859175304", "20110510123900143304", 175_304_000),
        ("color_20110510T123859.17Z", "color_20110510T123900.143304Z", 170_000_000),
        ("20110510_123859_175", "20110510_123900_143", 175_000_000),
        ("20110510_123859_75", "20110510_123900_143", 75_000_000),
        ("20110510_123859_175304001", "20110510_123900_143304001", 175_304_001),
        ("2011-05-10 12.38.59", "2011-05-10 12.39.00", 0),
    ],
)
def test_a_date_and_time_goes_on_beyond_the_minute(tmp_path: Path, before: str, after: str, part_ns: int) -> None:
    found = stamps_of(tmp_path, [after, before])
    assert list(found) == [before, after]
    assert found[before] == LAST_OF_A_MINUTE * 10**9 + part_ns
    assert 0.9e9 < found[after] - found[before] < 1.1e9


def test_a_counter_behind_a_date_counts_frames(tmp_path: Path) -> None:
    names = [f"20110510_1238{i // 2:02}_{i:03}" for i in range(6)]
    assert list(stamps_of(tmp_path, names).values()) == [round(i * 1e9 / 30) for i in range(6)]


@pytest.mark.parametrize(
    "names",
    [
        ["12-38-58.9", "12-38-59.8", "12-39-00.7"],
        ["12_38_59_175", "12_39_00_143", "12_39_01_111"],
        ["scene1_0001", "scene1_0002", "scene2_0001"],
    ],
)
def test_numbers_that_contradict_those_before_them_are_no_order(
    tmp_path: Path, names: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    assert stamps_of(tmp_path, names) == {}
    assert "left out, with 2 more" in caplog.text
    assert "rename the images, or list them" in caplog.text


def test_a_counter_and_a_time_that_grow_together_agree(tmp_path: Path) -> None:
    assert list(stamps_of(tmp_path, ["9_1305031102.5", "10_1305031103.5"]).values()) == [
        1_305_031_102_500_000_000,
        1_305_031_103_500_000_000,
    ]
