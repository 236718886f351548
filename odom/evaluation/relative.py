"""Files of relative poses with covariance, as `odom run --out` leaves them, and their NEES against truth.

One line a frame: `stamp_earlier stamp_current tx ty tz qx qy qz qw c00 c01 .. c55`, the pose of the current frame in
the earlier one and the upper triangle of its 6 x 6 covariance, row by row (`registration.se3` convention).
"""

from dataclasses import dataclass
from decimal import InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from odom.errors import SourceError
from odom.evaluation.files import nanoseconds
from odom.evaluation.metrics import Nees, nees, tangent_errors
from odom.evaluation.trajectory import Stamps, Trajectory, inverse_all

Array = NDArray[np.float64]

_FIELDS = 30


@dataclass(frozen=True, eq=False)
class RelativePoses:
    """n poses `T_earlier_current` (n x 4 x 4) with covariances (n x 6 x 6) between two stamps each (n, ns)."""

    stamps_earlier: Stamps
    stamps_current: Stamps
    T_earlier_current: Array
    covariances: Array

    def __len__(self) -> int:
        return len(self.stamps_current)


def read_relative(path: Path) -> RelativePoses:
    """Read a file of relative poses; a last line cut short by a crash is left out.

    Raises SourceError naming the line that cannot be read.
    """
    stamps: list[tuple[int, int]] = []
    values: list[list[float]] = []
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise SourceError(f"{path} cannot be read: {error}") from error
    for number, line in enumerate(lines, 1):
        fields = line.split("#", 1)[0].split()
        if not fields or (len(fields) < _FIELDS and number == len(lines)):
            continue
        try:
            if len(fields) != _FIELDS:
                raise ValueError(f"{len(fields)} fields")
            stamps.append((nanoseconds(fields[0]), nanoseconds(fields[1])))
            values.append([float(field) for field in fields[2:]])
        except (ValueError, InvalidOperation, OverflowError) as error:
            raise SourceError(f"{path}:{number}: not a relative pose of {_FIELDS} fields ({error})") from error
    numbers = np.array(values).reshape(-1, _FIELDS - 2)
    when = np.array(stamps, dtype=np.int64).reshape(-1, 2)
    T = np.tile(np.eye(4), (len(numbers), 1, 1))
    T[:, :3, 3] = numbers[:, :3]
    if len(numbers):
        T[:, :3, :3] = Rotation.from_quat(numbers[:, 3:7]).as_matrix()
    covariances = np.zeros((len(numbers), 6, 6))
    covariances[:, *np.triu_indices(6)] = numbers[:, 7:]
    covariances += np.triu(covariances, 1).transpose(0, 2, 1)
    return RelativePoses(when[:, 0], when[:, 1], T, covariances)


def relative_errors_of(
    poses: RelativePoses, truth: Trajectory, max_gap_s: float = 0.1
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the tangent errors `log(inv(T_estimate) T_true)` (m x 6) and which poses they belong to.

    Truth is that of the same body; a pose is left out when truth is missing at one of its two stamps.
    """
    earlier, valid_earlier = truth.at(poses.stamps_earlier, max_gap_s)
    current, valid_current = truth.at(poses.stamps_current, max_gap_s)
    valid = valid_earlier & valid_current
    T_true = inverse_all(earlier[valid]) @ current[valid]
    return tangent_errors(poses.T_earlier_current[valid], T_true), valid


def relative_nees(poses: RelativePoses, truth: Trajectory, max_gap_s: float = 0.1) -> Nees:
    """Return the NEES of the relative poses whose two stamps both have truth (of the same body)."""
    errors, valid = relative_errors_of(poses, truth, max_gap_s)
    return nees(errors, poses.covariances[valid])
