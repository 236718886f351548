"""Trajectories as text files: TUM, KITTI and Motive's CSV."""

import re
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from odom.errors import SourceError
from odom.evaluation.trajectory import Trajectory

Array = NDArray[np.float64]

_SEGMENT = re.compile(r"#\s*segment\s+(\d{1,9})\s*$")


def nanoseconds(text: str) -> int:
    """Return the nanoseconds of decimal seconds, exponents allowed, without passing through a float.

    Raises InvalidOperation, ValueError or OverflowError (64 bits).
    """
    value = Decimal(text)
    if value.is_finite() and abs(value) > 9_000_000_000:
        raise OverflowError(f"{text} seconds")
    return int((value * 1_000_000_000).to_integral_value())


def read_tum(path: Path) -> Trajectory:
    """Read `stamp tx ty tz qx qy qz qw` lines (seconds, metres); `#` starts a comment.

    A comment `# segment N`, as `odom run` writes it, begins a segment.

    Raises SourceError naming the line that cannot be read.
    """
    stamps: list[int] = []
    values: list[list[float]] = []
    segments: list[int] = []
    segment = 0
    for number, line in enumerate(_text(path).splitlines(), 1):
        begun = _SEGMENT.match(line)
        segment = int(begun[1]) if begun else segment
        fields = line.split("#", 1)[0].replace(",", " ").split()
        if not fields:
            continue
        try:
            if len(fields) != 8:
                raise ValueError(f"{len(fields)} fields")
            stamps.append(nanoseconds(fields[0]))
            values.append([float(field) for field in fields[1:]])
            segments.append(segment)
        except (ValueError, InvalidOperation, OverflowError) as error:
            raise SourceError(f"{path}:{number}: not a pose `stamp tx ty tz qx qy qz qw` ({error})") from error
    return trajectory_of(path, stamps, np.array(values).reshape(-1, 7), segments)


def read_kitti(path: Path, times: Path) -> Trajectory:
    """Read twelve numbers a line (the upper 3 x 4 of `T_world_body`, row by row) and their `times`, a line each.

    Raises SourceError when a line cannot be read, the counts differ or a rotation is none.
    """
    rows, stamps = [], []
    for number, line in enumerate(_text(path).splitlines(), 1):
        try:
            if line.split():
                rows.append(np.array([float(field) for field in line.split()]).reshape(3, 4))
        except ValueError as error:
            raise SourceError(f"{path}:{number}: not a pose of twelve numbers ({error})") from error
    for number, line in enumerate(_text(times).splitlines(), 1):
        try:
            if line.split():
                stamps.append(nanoseconds(line.split()[0]))
        except (InvalidOperation, OverflowError, ValueError) as error:
            raise SourceError(f"{times}:{number}: not a time in seconds") from error
    if len(rows) != len(stamps):
        raise SourceError(
            f"{path} has {len(rows)} poses but {times} has {len(stamps)} times: give the poses' own times"
        )
    P = np.array(rows).reshape(-1, 3, 4)
    if len(P) and not np.allclose(P[:, :, :3] @ P[:, :, :3].transpose(0, 2, 1), np.eye(3), atol=1e-2):
        raise SourceError(f"{path}: the left 3 x 3 of a pose is not a rotation")
    quaternions = Rotation.from_matrix(P[:, :, :3]).as_quat() if len(P) else np.zeros((0, 4))
    return trajectory_of(path, stamps, np.column_stack([P[:, :, 3], quaternions]))


def trajectory_of(
    path: Path, stamps: list[int], translation_quaternion: Array, segments: list[int] | None = None
) -> Trajectory:
    """Return the trajectory of n stamps (ns) and n x 7 values (t, q as x y z w), sorted, repeated stamps dropped.

    Raises SourceError when a value is not finite or a quaternion has no length.
    """
    norms = np.linalg.norm(translation_quaternion[:, 3:], axis=1)
    if not np.isfinite(translation_quaternion).all() or (np.abs(norms - 1.0) > 0.1).any():
        raise SourceError(f"{path}: a pose is not finite or its quaternion has not length one")
    T = np.tile(np.eye(4), (len(stamps), 1, 1))
    if stamps:
        T[:, :3, :3] = Rotation.from_quat(translation_quaternion[:, 3:]).as_matrix()
    T[:, :3, 3] = translation_quaternion[:, :3]
    unique, first = np.unique(np.array(stamps, dtype=np.int64), return_index=True)
    several = np.array(segments)[first] if segments and len(set(segments)) > 1 else None
    return Trajectory(unique, T[first], several)


def write_tum(path: Path, trajectory: Trajectory) -> None:
    """Write a trajectory as TUM text, stamps with nine decimals."""
    rotations = trajectory.T_world_body[:, :3, :3]
    quaternions = Rotation.from_matrix(rotations).as_quat() if len(trajectory) else np.zeros((0, 4))
    with path.open("w") as file:
        for stamp, t, q in zip(trajectory.stamps, trajectory.positions, quaternions, strict=True):
            seconds = f"{stamp // 1_000_000_000}.{stamp % 1_000_000_000:09d}"
            file.write(f"{seconds} " + " ".join(f"{value:.9f}" for value in (*t, *q)) + "\n")


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise SourceError(f"{path} cannot be read: {error}") from error
