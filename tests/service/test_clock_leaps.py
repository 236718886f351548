"""A clock that leaps back within a recording: the same moment comes twice, and no trajectory is made of both."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from odom import Trajectory, read_tum
from odom.evaluation.times import of_one_time

ODOM = [sys.executable, "-m", "odom"]
ARENA = Path(__file__).parents[2] / "recordings" / "arena.mcap"
LEAP_AFTER_NS, LEAP_NS, END_NS = 6_000_000_000, 4_000_000_000, 11_000_000_000


@pytest.fixture(scope="module")
def leaping(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eleven seconds of the arena, of which the last five are stamped four seconds too early."""
    path = tmp_path_factory.mktemp("leaping") / "leaping.mcap"
    with ARENA.open("rb") as source, path.open("wb") as target:
        reader, writer = make_reader(source), Writer(target)
        writer.start()
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        begun: int | None = None
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            begun = begun or message.log_time
            if message.log_time - begun > END_NS:
                break
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata
                )
            data = message.data
            if message.log_time - begun > LEAP_AFTER_NS:
                data = stamped_earlier(data)
            writer.add_message(channels[channel.id], message.log_time, data, message.publish_time, message.sequence)
        writer.finish()
    return path


def stamped_earlier(cdr: bytes) -> bytes:
    """The message with an earlier stamp, with which its header begins behind the four bytes of CDR."""
    seconds, nanoseconds = np.frombuffer(cdr[4:12], "<u4").tolist()
    stamp = seconds * 10**9 + nanoseconds - LEAP_NS
    return cdr[:4] + np.array(divmod(stamp, 10**9), "<u4").tobytes() + cdr[12:]


@pytest.fixture(scope="module")
def ran(leaping: Path, compiled: None) -> Path:
    out = leaping.parent / "out"
    subprocess.run([*ODOM, "run", str(leaping), "--headless", "--out", str(out)], check=True)
    return out


def test_one_of_both_times_is_judged_and_the_report_says_so(ran: Path) -> None:
    report = json.loads((ran / "report.json").read_text())
    assert report["ate_m"] < 0.005
    assert report["ate_online_m"] < 0.01
    assert report["nees_mean"] < 12.0
    assert report["nees_step_mean"] < 12.0
    assert report["chain"]["ate_m"] < 0.05
    assert any("leapt back" in note for note in report["truth_notes"])
    assert 40 < report["matched"] < report["total"]


@pytest.mark.long
def test_no_pose_of_the_other_time_is_exported(leaping: Path, ran: Path, tmp_path: Path) -> None:
    for name, source in (("run", ran), ("recording", leaping)):
        out = tmp_path / name
        subprocess.run([*ODOM, "export", str(source), "--to", "tum", "--out", str(out)], check=True)
        trajectory = read_tum(out / "trajectory.txt")
        assert len(trajectory) > 40
        steps_m = np.linalg.norm(np.diff(trajectory.positions, axis=0), axis=1)
        assert steps_m.max() < 0.15  # of a frame of 7.5 Hz; between both times it is metres


def test_times_that_overlap_are_told_apart_and_others_stay_together() -> None:
    first, second = np.arange(0, 30) * 10**8, np.arange(10, 35) * 10**8 + 3 * 10**7
    both = np.concatenate([first, second])
    np.testing.assert_array_equal(np.flatnonzero(of_one_time(both)), np.arange(30))
    np.testing.assert_array_equal(np.flatnonzero(of_one_time(both, second)), np.arange(30, 55))
    assert of_one_time(np.concatenate([first + 10**12, second])).all()
    assert of_one_time(np.random.default_rng(0).permutation(both)).all()
    assert of_one_time(both[:0]).all()


def test_truth_is_of_the_time_that_the_estimate_is_of() -> None:
    poses = {stamp: np.eye(4) for stamp in (*range(0, 10**10, 10**8), *range(5 * 10**9 + 1, 20 * 10**9, 10**8))}
    early = Trajectory(np.array([10**8, 9 * 10**9]), np.tile(np.eye(4), (2, 1, 1)))
    assert Trajectory.by_stamp(poses, early).stamps[-1] < 10**10
    assert Trajectory.by_stamp(poses).stamps[0] > 5 * 10**9
