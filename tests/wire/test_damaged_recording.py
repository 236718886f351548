"""What a flipped bit costs: what it hit, and nothing else; and what is lost is told by topic and time."""

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from made_up_messages import session_messages
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk, Header

from odom.errors import RecordingError
from odom.wire import Message
from odom.wire.recording import RecordingReader, RecordingWriter, recover
from odom.wire.recording.mcap_walk import walk

CHUNKS = 8


@pytest.fixture(scope="module")
def messages() -> list[Message]:
    return session_messages(24, height=24, width=32)


@pytest.fixture(scope="module", params=["zstd", "lz4", "none"])
def sound(request: pytest.FixtureRequest, messages: list[Message], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sound") / "sound.mcap"
    with RecordingWriter(path, compression=request.param, metadata={"source": "drawn"}) as writer:
        for number, message in enumerate(messages):
            if number and number % (len(messages) // CHUNKS) == 0:
                writer._writer.flush()
            writer.write(message)
    return path


def offsets(path: Path, opcode: Opcode) -> list[int]:
    with path.open("rb") as file:
        return [record.offset for record in walk(file, path.stat().st_size, None) if record.opcode == opcode]


def index_of(path: Path) -> int:
    """Return where the index begins, by the footer."""
    return int.from_bytes(path.read_bytes()[-28:-20], "little")


def damaged(sound: Path, where: int, bit: int, with_index: bool, path: Path) -> Path:
    content = bytearray(sound.read_bytes())
    content[where] ^= 1 << bit
    path.write_bytes(content if with_index else content[: index_of(sound)])
    return path


def read(path: Path) -> tuple[list[Message], RecordingReader]:
    reader = RecordingReader(path)
    return list(reader.messages()), reader


@pytest.mark.parametrize("with_index", [True, False])
@pytest.mark.parametrize("which", [0, 3, CHUNKS - 1])
def test_a_flipped_bit_in_a_chunks_opcode_costs_nothing_and_is_told(
    sound: Path, messages: list[Message], tmp_path: Path, which: int, with_index: bool
) -> None:
    where = offsets(sound, Opcode.CHUNK)[which]
    for bit in range(8):
        back, reader = read(damaged(sound, where, bit, with_index, tmp_path / "a.mcap"))
        assert back == messages
        assert f"byte {where}" in reader.damage[0]
        assert not reader.complete


@pytest.mark.parametrize("with_index", [True, False])
@pytest.mark.parametrize("record", ["length", "size", "unpacked", "name"])
def test_a_flipped_bit_in_a_chunks_sizes_costs_nothing(
    sound: Path, messages: list[Message], tmp_path: Path, record: str, with_index: bool
) -> None:
    chunk = offsets(sound, Opcode.CHUNK)[3]
    name = int.from_bytes(sound.read_bytes()[chunk + 37 : chunk + 41], "little")
    begin = {"length": 1, "unpacked": 25, "name": 41, "size": 41 + name}[record]
    for byte in range(name) if record == "name" else (0, 1, 2, 3, 7):
        for bit in (0, 4, 7):
            back, reader = read(damaged(sound, chunk + begin + byte, bit, with_index, tmp_path / "a.mcap"))
            assert back == messages, (byte, bit)
            if record == "length":
                assert reader.damage
                assert not reader.complete


@pytest.mark.parametrize("with_index", [True, False])
@pytest.mark.parametrize("which", [3, *(pytest.param(which, marks=pytest.mark.long) for which in (4, 5))])
def test_a_flipped_bit_anywhere_between_chunks_costs_nothing(
    sound: Path, messages: list[Message], tmp_path: Path, which: int, with_index: bool
) -> None:
    """The head of a message index, at its opcode and each byte of its length."""
    where = offsets(sound, Opcode.MESSAGE_INDEX)[which]
    for byte in range(9):
        for bit in (0, 1, 3, 6):
            back, _ = read(damaged(sound, where + byte, bit, with_index, tmp_path / "a.mcap"))
            assert back == messages, (byte, bit)


def test_a_flipped_bit_in_the_first_or_last_mark_costs_nothing(
    sound: Path, messages: list[Message], tmp_path: Path
) -> None:
    for where in (0, 3, 7, -1, -5):
        back, reader = read(damaged(sound, where, 2, True, tmp_path / "a.mcap"))
        assert back == messages
        assert reader.damage
        assert not reader.complete


def test_a_flipped_bit_in_the_index_costs_nothing_and_is_told(
    sound: Path, messages: list[Message], tmp_path: Path
) -> None:
    begin, size = index_of(sound), sound.stat().st_size
    for where in range(begin, size - 8, max(1, (size - begin) // 40)):
        back, reader = read(damaged(sound, where, 1, True, tmp_path / "a.mcap"))
        assert back == messages
        assert reader.damage
        assert reader.counts() is None


@pytest.mark.parametrize("with_index", [True, False])
def test_what_a_damaged_chunk_held_is_told_by_topic_and_time(
    sound: Path, messages: list[Message], tmp_path: Path, with_index: bool
) -> None:
    content = sound.read_bytes()
    chunk, after = offsets(sound, Opcode.CHUNK)[3], offsets(sound, Opcode.CHUNK)[4]
    length = int.from_bytes(content[chunk + 1 : chunk + 9], "little")
    back, reader = read(damaged(sound, chunk + 9 + length - 40, 5, with_index, tmp_path / "a.mcap"))
    lost = [message for message in messages if message not in back]
    assert after > chunk
    assert 0 < len(lost) < 2 * len(messages) / CHUNKS
    told = reader.damage[0]
    for topic, count in Counter(message.topic for message in lost).items():
        assert f"{count} of /{topic}" in told
    assert f"from {min(m.stamp for m in lost) * 1e-9:.3f} to {max(m.stamp for m in lost) * 1e-9:.3f} s" in told


def test_recover_saves_and_tells_the_same_as_reading(sound: Path, messages: list[Message], tmp_path: Path) -> None:
    hit = damaged(sound, offsets(sound, Opcode.CHUNK)[2], 4, True, tmp_path / "hit.mcap")
    count, damage = recover(hit, tmp_path / "mended.mcap")
    assert count == len(messages)
    assert damage
    back, reader = read(tmp_path / "mended.mcap")
    assert back == messages
    assert reader.complete


def file_of(path: Path, chunk: Chunk) -> Path:
    builder = RecordBuilder()
    Header("ros2", "drawn").write(builder)
    chunk.write(builder)
    path.write_bytes(b"\x89MCAP0\r\n" + builder.end())
    return path


_PEAK = """
import re, sys
from pathlib import Path
from odom.cli import main
try:
    main()
finally:
    status = Path("/proc/self/status").read_text()  # getrusage would count the memory of the tests themselves
    print("peak", int(re.search(r"VmHWM:\\s+(\\d+)", status)[1]) // 1024, file=sys.stderr)
"""


def info(path: Path) -> tuple[int, str, int]:
    """Return status, words and peak memory (MB) of `odom info`."""
    command = [sys.executable, "-c", _PEAK, "info", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    return done.returncode, done.stdout + done.stderr, int(done.stderr.rsplit("peak ", 1)[1])


def lz4_bomb(path: Path) -> Path:
    compressor = lz4.frame.LZ4FrameCompressor()
    packed = compressor.begin() + b"".join(compressor.compress(bytes(64 << 20)) for _ in range(32)) + compressor.flush()
    return file_of(path, Chunk("lz4", packed, 2, 1, 7, 1000))


def zstd_bomb(path: Path) -> Path:
    compressor = zstandard.ZstdCompressor().compressobj()
    packed = b"".join(compressor.compress(bytes(64 << 20)) for _ in range(32)) + compressor.flush()
    return file_of(path, Chunk("zstd", packed, 2, 1, 7, 1000))


def sparse(path: Path) -> Path:
    builder = RecordBuilder()
    Header("ros2", "drawn").write(builder)
    begin = b"\x89MCAP0\r\n" + builder.end()
    head = bytes([Opcode.CHUNK]) + (6 << 30).to_bytes(8, "little")
    body = bytes(24 + 4 + 4) + ((6 << 30) - 40).to_bytes(8, "little")
    with path.open("wb") as file:
        file.write(begin + head + body)
        file.truncate(len(begin) + 9 + (6 << 30))
    return path


@pytest.mark.parametrize(
    ("make", "why"), [(lz4_bomb, "says 1000"), (zstd_bomb, "says 1000"), (sparse, "6442450904 bytes")]
)
def test_a_chunk_of_gigabytes_is_refused_by_name_in_little_memory(
    tmp_path: Path, make: Callable[[Path], Path], why: str
) -> None:
    status, words, peak_mb = info(make(tmp_path / "a.mcap"))
    assert status == 1
    assert "chunk at byte" in words
    assert why in words
    assert peak_mb <= 300


def test_a_pipe_is_refused_and_does_not_block(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    with pytest.raises(RecordingError, match="regular file"):
        read(tmp_path / "pipe.mcap")
