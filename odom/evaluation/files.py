"""Trajectories as files: TUM text."""

from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from odom.errors import SourceError
from odom.evaluation.trajectory import Trajectory

Array = NDArray[np.float64]


def nanoseconds(text: str) -> int:
    """Return the nanoseconds of decimal seconds, exponents allowed, without passing through a float."""
    return int((Decimal(text) * 1_000_000_000).to_integral_value())


def read_tum(path: Path) -> Trajectory:
    """Read `stamp tx ty tz qx qy qz qw` lines (seconds, metres); `#` starts a comment.

    Raises SourceError naming the line that cannot be read.
    """
    stamps: list[int] = []
    values: list[list[float]] = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        fields = line.split("#", 1)[0].replace(",", " ").split()
        if not fields:
            continue
        try:
            if len(fields) != 8:
                raise ValueError(f"{len(fields)} fields")
            stamps.append(nanoseconds(fields[0]))
            values.append([float(field) for field in fields[1:]])
        except (ValueError, InvalidOperation, OverflowError) as error:
            raise SourceError(f"{path}:{number}: not a pose `stamp tx ty tz qx qy qz qw` ({error})") from error
    return trajectory_of(path, stamps, np.array(values).reshape(-1, 7))


def trajectory_of(path: Path, stamps: list[int], translation_quaternion: Array) -> Trajectory:
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
    return Trajectory(unique, T[first])


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
