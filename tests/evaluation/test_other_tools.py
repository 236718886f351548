"""Trajectories as other tools write them: their stamps, the order of their columns, what they write where they lost."""

import logging
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic import smooth, trajectory

import odom
from odom.evaluation import Trajectory
from odom.evaluation.files import read_tum

START_S = 1.7e9


@pytest.fixture(scope="module")
def walk() -> Trajectory:
    return trajectory(smooth(np.random.default_rng(0)), np.arange(0, 3, 0.02), START_S)


def pose_fields(T: np.ndarray) -> list[str]:
    """The seven numbers of a pose as TUM's format has them."""
    return [f"{value:.9f}" for value in (*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat())]


def written(path: Path, walk: Trajectory, stamp_text, order=range(7), between=" ", head="", end="") -> Path:
    """A text file with a pose a line, its seven numbers in `order`."""
    lines = [head]
    for stamp, T in zip(walk.stamps.tolist(), walk.T_world_body, strict=True):
        fields = pose_fields(T)
        lines.append(between.join([stamp_text(stamp), *(fields[k] for k in order)]) + end + "\n")
    path.write_text("".join(lines))
    return path


def in_seconds(stamp: int) -> str:
    return f"{stamp // 10**9}.{stamp % 10**9:09d}"


def assert_same(read: Trajectory, walk: Trajectory) -> None:
    np.testing.assert_allclose(read.stamps, walk.stamps, atol=1000)
    np.testing.assert_allclose(read.T_world_body, walk.T_world_body, atol=1e-7)


@pytest.mark.parametrize(
    ("unit", "stamp_text"),
    [
        ("nanoseconds", str),
        ("nanoseconds", lambda stamp: f"{stamp}.000000"),  # as ORB-SLAM3 writes EuRoC's sequences
        ("nanoseconds", lambda stamp: f"{stamp:.18e}"),  # as numpy writes a column of an array
        ("microseconds", lambda stamp: str(stamp // 1000)),
        ("milliseconds", lambda stamp: f"{stamp / 1e6:.3f}"),
        ("", in_seconds),
    ],
)
def test_stamps_since_1970_in_finer_units_are_known_by_their_digits(tmp_path, caplog, walk, unit, stamp_text):
    caplog.set_level(logging.INFO)
    assert_same(odom.read_tum(written(tmp_path / "t.txt", walk, stamp_text)), walk)
    assert [f"taken for {unit}" in record.message for record in caplog.records] == ([True] if unit else [])


def test_a_stamp_that_is_a_time_in_no_unit_is_refused_with_its_line(tmp_path, walk):
    path = written(tmp_path / "t.txt", walk, lambda stamp: f"{stamp}000")
    with pytest.raises(odom.SourceError, match=r"t\.txt:1: .* since 1970"):
        read_tum(path)
