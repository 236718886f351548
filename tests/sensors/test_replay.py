"""A recording played in part: what comes, and how much of the file is read for it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from odom.frame import Camera, Stamp
from odom.wire import Message, Topics
from odom.wire.codec import encode_camera_info, encode_color, encode_depth
from odom.wire.recording import RecordingReader, RecordingWriter
from odom.wire.recording.mcap_file import McapFile
from sensors.catalogue import open_source
from sensors.source import SourceOptions, damage_of

TOPICS = Topics("cam0")
BEGIN = 1_700_000_000_000_000_000
PERIOD_NS = 33_333_333
FRAMES = 1000


def record(path: Path, shift_ns: dict[int, int]) -> Path:
    """Record 2000 images whose stamps are those of a camera at 30 Hz, the frames of `shift_ns` moved by so much."""
    color, depth = np.zeros((12, 16, 3), dtype=np.uint8), np.full((12, 16), 1000, dtype=np.uint16)
    with RecordingWriter(path) as writer:
        writer.write(encode_camera_info(TOPICS.camera_info, Stamp(BEGIN), Camera(16, 12, 14.0, 14.0, 7.5, 5.5)))
        for index in range(FRAMES):
            stamp = Stamp(BEGIN + index * PERIOD_NS + shift_ns.get(index, 0))
            writer.write(encode_depth(TOPICS.depth, stamp, depth))
            writer.write(encode_color(TOPICS.color, stamp, color))
    return path


def images(path: Path, end: float) -> list[Message]:
    source = open_source(str(path), SourceOptions(topics=TOPICS, end=end))
    try:
        return [message for message in source.messages() if message.topic in (TOPICS.color, TOPICS.depth)]
    finally:
        source.close()


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of messages that each reading of a file took from it."""
    counts: list[int] = []
    whole = McapFile.messages

    def counted(self: McapFile, *arguments: Any) -> Iterator[Any]:
        counts.append(0)
        for found in whole(self, *arguments):
            counts[-1] += 1
            yield found

    monkeypatch.setattr(McapFile, "messages", counted)
    return counts


def test_what_lies_behind_the_end_is_not_read(tmp_path: Path, read: list[int]) -> None:
    played = images(record(tmp_path / "long.mcap", {}), end=1.0)
    expected = [BEGIN + index * PERIOD_NS for index in range(FRAMES) if index * PERIOD_NS < 1_000_000_000]
    for topic in (TOPICS.color, TOPICS.depth):
        assert [m.stamp for m in played if m.topic == topic] == expected
    assert read[-1] < 400


def test_single_stray_stamps_do_not_end_a_part(tmp_path: Path) -> None:
    strays = {20: 3600 * 10**9, 100: 7200 * 10**9, 300: 1800 * 10**9}
    played = images(record(tmp_path / "strays.mcap", strays), end=20.0)
    assert len(played) == 2 * sum(index not in strays and index * PERIOD_NS < 20 * 10**9 for index in range(FRAMES))


@pytest.mark.parametrize("begins_at", [-BEGIN, -3600 * 10**9])
def test_a_part_is_counted_from_the_first_stamp_that_others_follow(tmp_path: Path, begins_at: int) -> None:
    """Some drivers stamp their first images with 0 or with what their buffer holds."""
    strays = {index: begins_at - index * PERIOD_NS for index in range(3)}
    played = images(record(tmp_path / "late.mcap", strays), end=1.0)
    kept = [message.stamp for message in played if message.stamp >= BEGIN]
    assert kept[0] == BEGIN + 3 * PERIOD_NS
    assert len(kept) == 2 * 31


def test_a_part_is_found_behind_images_stamped_before_the_clock_was_set_back(tmp_path: Path) -> None:
    ahead = dict.fromkeys(range(500), 3600 * 10**9)
    assert len(images(record(tmp_path / "set_back.mcap", ahead), end=9.99)) == 600


def test_of_many_damages_the_first_are_told_and_the_others_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    source = open_source(str(record(tmp_path / "a.mcap", {})), SourceOptions(topics=TOPICS))
    whole = RecordingReader.messages

    def damaged(self: RecordingReader, *arguments: Any) -> Iterator[Message]:
        yield from whole(self, *arguments)
        self.damage = tuple(f"chunk {i} is damaged" for i in range(40))

    monkeypatch.setattr(RecordingReader, "messages", damaged)
    assert len(list(source.messages())) == 2 * FRAMES + 1
    assert len([record for record in caplog.records if record.levelname == "WARNING"]) == 6
    assert "35 more" in caplog.records[-1].getMessage()


def test_a_source_says_whether_its_recording_was_cut(tmp_path: Path) -> None:
    whole, cut = record(tmp_path / "whole.mcap", {}), tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    said = []
    for path in (whole, cut):
        source = open_source(str(path), SourceOptions(topics=TOPICS))
        list(source.messages())
        said.append(damage_of(source))
    assert said[0] == []
    assert [words.startswith("cut at byte") for words in said[1]] == [True]
