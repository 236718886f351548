import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from odom.errors import ConfigError
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import decode_pose
from odom.wire.image_counts import NO_COLOR
from odom.wire.recording import RecordingReader
from sensors.arena import ArenaFrame, ArenaOptions, frame, open_arena
from sensors.arena import source as arena_source
from sensors.catalogue import open_source
from sensors.source import SourceOptions

RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"


def test_messages_come_in_the_order_of_their_stamps_and_make_every_frame() -> None:
    options = SourceOptions(seconds=1.0, extra=(("exact_truth", "yes"),))
    source = open_source("arena", options)
    assert source.lossless
    assert source.length == 30
    messages = list(source.messages())
    stamps = [m.stamp for m in messages]
    assert stamps == sorted(stamps)
    kinds = Counter(m.topic for m in messages)
    assert kinds["cam0/color/image_raw/compressed"] == kinds["cam0/depth/image_raw"] == 30
    assert kinds["truth/exact_camera/pose"] == 30
    assert 105 < kinds["truth/kinect/pose"] <= 120
    assembler = FrameAssembler(options.topics)
    frames = [f for m in messages for f in assembler.feed(m)] + list(assembler.finish())
    assert len(frames) == 30
    assert (assembler.pairing.color_single, assembler.pairing.depth.refused[NO_COLOR]) == (0, 0)
    assert not assembler.malformed.counts
    arena = ArenaOptions(seconds=1.0)
    assert assembler.camera == arena.camera
    truth = [decode_pose(m) for m in messages if m.topic == "truth/exact_camera/pose"]
    shot = frame(arena, 17)
    assert np.array_equal(frames[17].depth_mm, shot.depth_mm)
    assert np.allclose(truth[17].T_parent_child, shot.T_world_camera)


def test_a_part_of_a_session_is_the_same_as_in_the_whole() -> None:
    def color(options: SourceOptions) -> dict[int, bytes]:
        messages = open_source("arena", options).messages()
        return {m.stamp: m.payload for m in messages if m.topic == options.topics.color_compressed}

    part, whole = color(SourceOptions(start=0.2, end=0.4)), color(SourceOptions(end=0.5))
    assert len(part) == 6
    assert part.items() <= whole.items()


def test_two_sessions_are_byte_equal() -> None:
    def session() -> list[tuple[str, int, bytes]]:
        source = open_source("arena", SourceOptions(seconds=0.5, color="raw", depth="rvl"))
        return [(m.topic, m.stamp, m.payload) for m in source.messages()]

    assert session() == session()


@pytest.mark.alone
def test_a_live_session_is_never_early_and_leaves_out_what_would_be_late() -> None:
    options = SourceOptions(seconds=1.5, live=True, extra=(("half", "1"),))
    source = open_arena(options)
    assert not source.lossless
    began = time.time_ns()
    behind, frames = [], 0
    for message in source.messages():
        if message.topic != options.topics.camera_info:
            behind.append(time.time_ns() - message.stamp)
        frames += message.topic == options.topics.color_compressed
    assert min(behind) > -2_000_000
    assert time.time_ns() - began > 1.4e9
    assert frames + source.skipped == 45


@pytest.mark.alone
def test_a_live_session_loses_no_frame_when_the_machine_is_busy_for_a_moment(monkeypatch) -> None:
    def drawn(arena: ArenaOptions, index: int) -> ArenaFrame:
        if index == 24:
            time.sleep(0.4)
        return frame(arena, index)

    monkeypatch.setattr(arena_source, "frame", drawn)
    options = SourceOptions(seconds=1.5, live=True, extra=(("half", "1"),))
    source = open_arena(options)
    behind = [time.time_ns() - m.stamp for m in source.messages() if m.topic == options.topics.color_compressed]
    assert len(behind) == 45
    assert source.skipped == 0
    assert max(behind) < 100_000_000


def test_a_closed_session_ends_and_tells_once_what_it_left_out(caplog: pytest.LogCaptureFixture) -> None:
    source = open_arena(SourceOptions(live=True))
    source.skipped = 2
    count = 0
    for _ in source.messages():
        count += 1
        if count == 20:
            source.close()
            source.close()
    assert count <= 21
    assert ["2 frames were left out" in record.getMessage() for record in caplog.records] == [True]


@pytest.mark.parametrize("options", [SourceOptions(extra=(("walk", "up"),)), SourceOptions(depth="none")])
def test_what_it_cannot_do_is_said(options: SourceOptions) -> None:
    with pytest.raises(ConfigError):
        open_source("arena", options)


def test_the_committed_recording_is_what_its_readme_says() -> None:
    assert RECORDING.stat().st_size <= 12_000_000
    reader = RecordingReader(RECORDING)
    options = SourceOptions(extra=(("half", "1"), ("every", "4")))
    assembler = FrameAssembler(options.topics)
    messages = list(reader.messages())
    assert reader.complete
    frames = [f for m in messages for f in assembler.feed(m)] + list(assembler.finish())
    assert len(frames) == 241
    arena = ArenaOptions(half=True, every=4)
    assert assembler.camera == arena.camera
    for k in (0, 120, 240):
        shot = frame(arena, 4 * k)
        assert frames[k].stamp == shot.stamp
        same = np.abs(frames[k].color.astype(int) - shot.rgb).mean()
        assert same < 6
        assert (frames[k].depth_mm == shot.depth_mm).mean() > 0.98


def test_a_session_stops_at_the_end_that_comes_first() -> None:
    assert [open_source("arena", SourceOptions(seconds=s, end=e)).length for s, e in ((9.0, 2.0), (2.0, 9.0))] == [
        60,
        60,
    ]
