"""Stamps whose nano- or microseconds were written without leading zeros, and those that only look so."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sensors.image_lists import read_list
from sensors.image_names import by_stamp
from sensors.listed_folders import associated
from sensors.split_stamps import without_leading_zeros

BEGIN = 1_700_000_000_123_456_789
STAMPS = [BEGIN + i * 33_333_333 + (i % 3) * 1_234_567 for i in range(90)]
"""Of a camera whose clock trembles by a millisecond or two."""


def unpadded(stamp: int, part_ns: int = 1) -> str:
    seconds, ns = divmod(stamp, 10**9)
    return f"{seconds}.{ns // part_ns}"


@pytest.mark.parametrize("part_ns", [1, 1_000])
@pytest.mark.parametrize("left_out", [1, 7])
def test_parts_without_leading_zeros_are_whole_nano_or_microseconds(part_ns: int, left_out: int) -> None:
    kept = [stamp // part_ns * part_ns for k, stamp in enumerate(STAMPS) if k % 11 != left_out]
    assert without_leading_zeros([unpadded(stamp, part_ns) for stamp in kept]) == kept


FRACTIONS: dict[str, Callable[[list[int]], list[str]]] = {
    "whose last zeros were left out": lambda stamps: [f"{s // 10**9}.{s % 10**9:09d}".rstrip("0") for s in stamps],
    "as Python prints a float": lambda stamps: [str(s / 1e9) for s in stamps],
    "rounded": lambda stamps: [str(round(s / 1e9, 3)) for s in stamps],
    "of images from now and then": lambda stamps: [
        unpadded(stamps[0] + int(s)) for s in np.cumsum(np.random.default_rng(0).exponential(2e9, len(stamps)))
    ],
    "of one image": lambda stamps: [unpadded(stamps[0])],
    "that are whole": lambda stamps: [str(s) for s in stamps],
}


@pytest.mark.parametrize("kind", FRACTIONS)
def test_fractions_stay_fractions(kind: str) -> None:
    assert without_leading_zeros(FRACTIONS[kind](STAMPS)) is None


def test_lists_and_names_without_leading_zeros_are_in_the_order_of_time_and_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = tmp_path / "rgb.txt"
    file.write_text("".join(f"{unpadded(stamp)} rgb/{k}.png\n" for k, stamp in enumerate(STAMPS)))
    listed = read_list(file, 1)
    assert [(entry.stamp, entry.values) for entry in listed] == [(s, (f"rgb/{k}.png",)) for k, s in enumerate(STAMPS)]
    named = by_stamp(tmp_path, [tmp_path / f"{unpadded(stamp)}.png" for stamp in STAMPS])
    assert [entry.stamp for entry in named] == STAMPS
    assert len([r for r in caplog.records if "without leading zeros" in r.getMessage()]) == 2


def test_both_stamps_of_a_list_of_pairs_may_lack_their_zeros(tmp_path: Path) -> None:
    (tmp_path / "depth").mkdir()
    lines = (f"{unpadded(s)} rgb/{k}.png {unpadded(s + 5_000_000)} depth/{k}.png\n" for k, s in enumerate(STAMPS))
    (tmp_path / "associations.txt").write_text("".join(lines))
    layout = associated(tmp_path)
    assert [entry.stamp for entry in layout.color] == STAMPS
    assert [entry.stamp for entry in layout.depth] == [stamp + 5_000_000 for stamp in STAMPS]
