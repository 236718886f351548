import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_messages import BEGIN, PERIOD_NS, session_messages

from odom.errors import RecordingError
from odom.frame import Stamp
from odom.wire import Message, Topics, truth
from odom.wire.codec import encode_odometry, encode_pose, encode_tf
from odom.wire.recording import RecordingReader, RecordingWriter, is_recording, recover
from odom.wire.recording.part_file import newest_part

CODECS = ("zstd", "lz4", "none")


def write(path: Path, messages: list[Message], compression: str = "zstd") -> Path:
    with RecordingWriter(path, compression=compression, overwrite=True) as writer:  # type: ignore[arg-type]  # one of CODECS
        for message in messages:
            writer.write(message)
    return path


def read(path: Path) -> tuple[list[Message], RecordingReader]:
    reader = RecordingReader(path)
    return list(reader.messages()), reader


@pytest.fixture(scope="module")
def messages() -> list[Message]:
    """Some 1.2 MB of small frames, compressed."""
    return session_messages(50, height=120, width=160)


@pytest.fixture(scope="module", params=CODECS)
def recording(
    request: pytest.FixtureRequest, messages: list[Message], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    return write(tmp_path_factory.mktemp("recording") / f"{request.param}.mcap", messages, request.param)


def test_what_was_written_is_read(recording: Path, messages: list[Message]) -> None:
    back, reader = read(recording)
    assert back == messages
    assert reader.complete
    assert reader.damage == ()
    assert reader.counts() == {stream.topic: stream.count for stream in reader.streams()}


def test_two_recordings_of_one_session_are_byte_equal(tmp_path: Path) -> None:
    small = session_messages(3)
    first = write(tmp_path / "a.mcap", small).read_bytes()
    assert write(tmp_path / "b.mcap", small).read_bytes() == first


def test_messages_come_by_stamp_although_recorded_out_of_order(tmp_path: Path) -> None:
    original = session_messages(30)
    delayed = sorted(original, key=lambda message: message.stamp + (50_000_000 if "depth" in message.topic else 0))
    assert delayed != original
    back, _ = read(write(tmp_path / "a.mcap", delayed))
    assert [message.stamp for message in back] == sorted(message.stamp for message in original)


def test_reading_can_begin_anywhere(recording: Path, messages: list[Message]) -> None:
    start = Stamp(BEGIN + 40 * PERIOD_NS)
    reader = RecordingReader(recording)
    assert list(reader.messages(start=start)) == [message for message in messages if message.stamp >= start]
    (poses,) = {message.topic for message in messages if message.topic.startswith("truth")}
    assert list(reader.messages({poses})) == [message for message in messages if message.topic == poses]


@pytest.mark.parametrize("cut", [False, True])
def test_a_topic_announced_in_a_skipped_chunk_is_still_read(tmp_path: Path, messages: list[Message], cut: bool) -> None:
    """Depth begins a second late, in a chunk that ends long before the reading starts."""
    early, late = Stamp(BEGIN + 10 * PERIOD_NS), Stamp(BEGIN + 48 * PERIOD_NS)
    path = tmp_path / "a.mcap"
    with RecordingWriter(path) as writer:
        for message in messages:
            if "depth" not in message.topic or message.stamp > early:
                writer.write(message)
                if message.stamp < early + 5 * PERIOD_NS:
                    writer._writer.flush()
    if cut:
        os.truncate(path, path.stat().st_size - 50)
    reader = RecordingReader(path)
    reader.streams()
    back = list(reader.messages(start=late))
    assert [m.stamp for m in back] == [m.stamp for m in messages if m.stamp >= late]
    assert bool(reader.damage) is cut


@pytest.mark.parametrize("hours", [-1, 1])
def test_reading_from_a_stamp_does_not_trust_the_clock_of_logging(
    tmp_path: Path, messages: list[Message], hours: int
) -> None:
    path, start = tmp_path / "a.mcap", Stamp(BEGIN + 40 * PERIOD_NS)
    with RecordingWriter(path) as writer:
        for message in messages:
            writer.write(message, Stamp(message.stamp + hours * 3600 * 10**9))
    reader = RecordingReader(path)
    for _ in range(2):
        assert [m.stamp for m in reader.messages(start=start)] == [m.stamp for m in messages if m.stamp >= start]
        reader.streams()


def test_a_file_cut_anywhere_reads_to_the_cut_and_says_so(recording: Path, messages: list[Message]) -> None:
    """At every 20,000th byte of the last megabyte."""
    counts = _cut(recording, messages, step=20_000)
    assert counts[0] == len(messages)
    assert recording.stat().st_size > 1_000_000


@pytest.mark.long
def test_a_file_cut_at_any_byte_of_its_end_or_often_before_reads_to_the_cut(
    recording: Path, messages: list[Message]
) -> None:
    _cut(recording, messages, step=3000)
    _cut(recording, messages, step=1, cuts=200)


@pytest.mark.parametrize("compression", CODECS)
def test_a_small_file_cut_at_any_byte_of_its_end_reads_to_the_cut(tmp_path: Path, compression: str) -> None:
    small = session_messages(4)
    _cut(write(tmp_path / "small.mcap", small, compression), small, step=1, cuts=200)


def _cut(recording: Path, messages: list[Message], step: int, cuts: int = 1_000_000) -> list[int]:
    """Cut a file short by more and more steps; return how many messages were read each time, none too many."""
    cut_file, whole = recording.with_suffix(".cut"), recording.read_bytes()
    cut_file.write_bytes(whole)
    size, counts = len(whole), []
    for length in range(size - 1, max(0, size - min(1_000_000, cuts * step)), -step):
        os.truncate(cut_file, length)
        back, reader = read(cut_file)
        assert back == messages[: len(back)]
        assert reader.damage
        assert not reader.complete
        assert f"{length}" in reader.damage[-1]
        counts.append(len(back))
    assert all(earlier >= later for earlier, later in pairwise(counts))
    return counts


@pytest.mark.parametrize("length", [0, 1, 7, 8, 20, 60])
def test_a_file_cut_at_its_beginning_is_empty_or_refused(tmp_path: Path, length: int) -> None:
    path = write(tmp_path / "a.mcap", session_messages(1))
    os.truncate(path, length)
    if length == 0:
        with pytest.raises(RecordingError, match="not an MCAP file"):
            read(path)
    else:
        assert read(path)[0] == []


def test_most_of_a_cut_chunk_is_saved(recording: Path, messages: list[Message]) -> None:
    """A cut in mid-file loses what comes behind it, not the whole chunk it lies in."""
    cut_file = recording.with_suffix(".middle")
    whole = recording.read_bytes()
    cut_file.write_bytes(whole[: int(0.9 * len(whole))])
    back, _ = read(cut_file)
    assert len(back) > 0.8 * len(messages)


@given(st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=20), st.sampled_from(CODECS))
def test_damage_anywhere_is_survived(
    tmp_path_factory: pytest.TempPathFactory, flips: list[tuple[float, int]], codec: str
) -> None:
    path = write(tmp_path_factory.mktemp("flip") / "a.mcap", session_messages(4), codec)
    content = bytearray(path.read_bytes())
    for where, value in flips:
        content[min(len(content) - 1, int(where * len(content)))] = value
    path.write_bytes(content)
    reader = RecordingReader(path)
    try:
        list(reader.messages())
        reader.counts()
        reader.streams()
    except RecordingError:
        assert bytes(content[:8]) != b"\x89MCAP0\r\n"


def test_a_damaged_chunk_costs_its_messages_only(tmp_path: Path, messages: list[Message]) -> None:
    path = tmp_path / "a.mcap"
    with RecordingWriter(path) as writer:
        for part in (messages[: len(messages) // 2], messages[len(messages) // 2 :]):
            for message in part:
                writer.write(message)
            time.sleep(0.3)  # a chunk ends with a quarter of a second
            writer.flush_if_due()
    content = bytearray(path.read_bytes())
    content[len(content) // 4] ^= 0xFF
    path.write_bytes(content)
    back, reader = read(path)
    assert len(messages) * 0.4 < len(back) < len(messages)
    assert len(reader.damage) == 1
    assert back[-1] == messages[-1]


def test_recover_mends_a_cut_recording(tmp_path: Path, recording: Path) -> None:
    cut_file, mended = tmp_path / "cut.mcap", tmp_path / "mended.mcap"
    whole = recording.read_bytes()
    cut_file.write_bytes(whole[: len(whole) * 3 // 4])
    saved, _ = read(cut_file)
    count, damage = recover(cut_file, mended)
    back, reader = read(mended)
    assert back == saved
    assert count == len(saved)
    assert damage
    assert reader.complete
    with pytest.raises(RecordingError, match="exists"):
        recover(cut_file, mended)
    for overwrite in (False, True):
        with pytest.raises(RecordingError, match="choose another name"):
            recover(cut_file, cut_file, overwrite=overwrite)


def test_a_recovery_that_is_interrupted_replaces_nothing(tmp_path: Path, recording: Path) -> None:
    target = write(tmp_path / "a.mcap", session_messages(1))
    before = target.read_bytes()
    with pytest.raises(RecordingError, match="stays as it was"):
        recover(recording, target, overwrite=True, stopped=lambda: True)
    assert target.read_bytes() == before
    assert list(tmp_path.iterdir()) == [target]


def test_an_existing_recording_is_not_overwritten_unasked(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", session_messages(1))
    with pytest.raises(RecordingError, match="exists"):
        RecordingWriter(path)


def test_a_recording_may_be_recorded_onto_itself(tmp_path: Path) -> None:
    """As by `odom sensor a.mcap` beside `odom record a.mcap --overwrite`."""
    messages = session_messages(20)
    path = write(tmp_path / "a.mcap", messages)
    with RecordingWriter(path, overwrite=True) as writer:
        for message in RecordingReader(path).messages():
            writer.write(message)
    assert read(path)[0] == messages
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("end", ["killed", "failed", "without a message"])
def test_a_recording_is_replaced_only_by_a_whole_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, end: str
) -> None:
    path = write(tmp_path / "a.mcap", session_messages(3))
    before, part = path.read_bytes(), tmp_path / "a.mcap.part"
    if end == "killed":
        command = [sys.executable, "-c", _KILLED_WRITER, str(path), str(Path(__file__).parent), "overwrite"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            while int(process.stdout.readline()) < BEGIN + 30 * PERIOD_NS:
                assert path.read_bytes() == before
            process.send_signal(signal.SIGKILL)
        with pytest.raises(RecordingError, match=f"odom recover {part}"):
            RecordingWriter(path, overwrite=True)
    elif end == "failed":
        with suppress(ZeroDivisionError), RecordingWriter(path, overwrite=True) as writer:
            for message in session_messages(20):
                writer.write(message)
            _ = 1 // 0
        assert f"odom recover {part}" in caplog.text
    else:
        with RecordingWriter(path, overwrite=True):
            pass
        assert "stays as it was" in caplog.text
    assert path.read_bytes() == before
    assert part.exists() == (end != "without a message")
    if part.exists():
        assert is_recording(part)
        assert recover(part, path, overwrite=True)[0] > 10


def test_on_a_full_disk_a_recording_ends_with_its_name_and_how_to_save_what_is_there(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, hard))
    full = pytest.raises(RecordingError, match=r"take\.mcap cannot be written any more: ")
    try:
        with full, RecordingWriter(tmp_path / "take.mcap", "none") as writer:
            for message in session_messages(40):
                writer.write(message)
                writer._chunk_began = 0.0  # long ago
                writer.flush_if_due()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "odom recover" in caplog.text
    recover(writer.part, tmp_path / "saved.mcap")
    assert sum(1 for _ in RecordingReader(tmp_path / "saved.mcap").messages()) > 10


def test_the_newest_of_the_parts_that_recorders_left_is_found(tmp_path: Path) -> None:
    for second, name in enumerate(("take-1.mcap.part", "take-2.mcap.part", "other.mcap.part", "take-3.mcap")):
        (tmp_path / name).write_bytes(b"")
        os.utime(tmp_path / name, (second, second))
    assert newest_part(tmp_path / "take-{time}.mcap") == tmp_path / "take-2.mcap.part"
    assert newest_part(tmp_path / "other.mcap") == tmp_path / "other.mcap.part"
    assert newest_part(tmp_path / "take-3.mcap") is None


@pytest.mark.parametrize("content", [b"", b"not a recording" * 10])
def test_other_files_are_named_for_what_they_are_not(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="not an MCAP file"):
        read(path)
    with pytest.raises(RecordingError, match="cannot be opened"):
        read(tmp_path / "nothing.mcap")


_KILLED_WRITER = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from made_up_messages import session_messages
from odom.wire.recording import RecordingWriter
writer = RecordingWriter(Path(sys.argv[1]), overwrite="overwrite" in sys.argv)
for message in session_messages(200):
    if message.topic.startswith("truth"):
        print(message.stamp, flush=True)
    writer.write(message)
    time.sleep(0.01)
"""


@pytest.mark.wallclock
def test_kill_9_costs_the_recording_half_a_second_at_most(tmp_path: Path) -> None:
    path = tmp_path / "killed.mcap"
    command = [sys.executable, "-c", _KILLED_WRITER, str(path), str(Path(__file__).parent)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        written: list[tuple[float, int]] = [(time.monotonic(), int(process.stdout.readline()))]
        deadline = time.monotonic() + 2.0
        while time.monotonic() < deadline:
            written.append((time.monotonic(), int(process.stdout.readline())))
        killed = time.monotonic()
        process.send_signal(signal.SIGKILL)
    assert not path.exists()
    back, reader = read(tmp_path / "killed.mcap.part")
    assert not reader.complete
    last = max(message.stamp for message in back if message.topic.startswith("truth"))
    assert max(at for at, stamp in written if stamp <= last) > killed - 0.5


def test_a_taken_name_is_refused_replaced_or_left_for_the_next_free_one(tmp_path: Path) -> None:
    path = write(tmp_path / "take.mcap", [])
    taken = path.read_bytes()
    with pytest.raises(RecordingError, match="exists already"):
        RecordingWriter(path)
    for number in (2, 3):
        with RecordingWriter(path, beside=True) as writer:
            assert writer.path == tmp_path / f"take-{number}.mcap"
        assert read(writer.path)[1].complete
    assert path.read_bytes() == taken


def test_a_recorder_started_again_within_a_second_neither_refuses_nor_overwrites(tmp_path: Path, endpoint: str) -> None:
    """The names of this and the next seconds are taken, as by a life that kill -9 has just ended."""
    before = {tmp_path / time.strftime("take-%Y%m%dT%H%M%SZ.mcap", time.gmtime(time.time() + s)) for s in range(90)}
    for path in before:
        path.write_bytes(b"an earlier life")
    command = [sys.executable, "-m", "odom", "record", str(tmp_path / "take-{time}.mcap"), "--listen", endpoint]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as recorder:
        deadline = time.monotonic() + 60
        while not set(tmp_path.iterdir()) - before and recorder.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        recorder.terminate()
        words, _ = recorder.communicate(timeout=30)
    assert "Z-2.mcap.part" in words
    assert all(path.read_bytes() == b"an earlier life" for path in before)


@pytest.fixture
def session_recording(tmp_path: Path) -> Path:
    """Images, truth and the estimates as the odometry publishes them, a second long."""
    topics, messages = Topics(), session_messages(40)
    for i in range(40):
        stamp, T = Stamp(BEGIN + i * PERIOD_NS + 5_000_000), np.eye(4)
        T[:3, 3] = 0.01 * i + 0.001 * (i % 2), 0.05 * np.sin(i / 5), 0.05 * np.cos(i / 7)
        messages.append(encode_pose(topics.pose, stamp, T, topics.frame_map))
        messages.append(encode_odometry(topics.odom, stamp, T, np.eye(6), topics.frame_odom, topics.frame_camera))
        messages.append(encode_tf(stamp, [("map", "odom", np.eye(4)), (topics.frame_odom, topics.frame_camera, T)]))
    return write(tmp_path / "session.mcap", messages)


def run(*command: str) -> Iterator[str]:
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    yield from done.stdout.splitlines()


def test_rerun_shows_images_depth_pinhole_poses_and_transforms(session_recording: Path, endpoint: str) -> None:
    scripts, rrd = Path(sys.executable).parent, session_recording.with_suffix(".rrd")
    port = endpoint.rsplit(":", 1)[1]
    list(run(str(scripts / "rerun"), str(session_recording), "--save", str(rrd), "--bind", "127.0.0.1", "--port", port))
    shown = "\n".join(run(str(scripts / "rerun"), "rrd", "stats", str(rrd)))
    for component in (
        "EncodedImage:blob",
        "DepthImage:buffer",
        "Pinhole:image_from_camera",
        "InstancePoses3D:translations",
        "Transform3D:translation",
    ):
        assert component in shown
    for entity in ("/cam0/color/image_raw/compressed", "/cam0/depth/image_raw", "/cam0/pose", "/tf"):
        assert entity in shown


def test_evo_judges_a_recording(session_recording: Path) -> None:
    evo = str(Path(sys.executable).parent / "evo_ape")
    told = "\n".join(run(evo, "mcap", str(session_recording), f"/{truth('camera')}", "/cam0/pose", "-a"))
    assert "rmse" in told
