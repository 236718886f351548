"""Files of relative poses with covariance, as `odom run --out` leaves them, and their NEES against truth.

One line a frame: `stamp_earlier stamp_current tx ty tz qx qy qz qw c00 c01 .. c55`, the pose of the current frame in
the earlier one and the upper triangle of its 6 x 6 covariance, row by row (`geometry.se3` convention).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from odom.evaluation.files import poses_of, read_rows
from odom.evaluation.metrics import Nees, nees, tangent_errors
from odom.evaluation.times import Stamps, of_one_time
from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask

if TYPE_CHECKING:
    from odom.backend import RelativePose
    from odom.frame import Stamp

_FIELDS = 30
"""Numbers in a line: two stamps, seven of the pose, 21 of the covariance."""


@dataclass(frozen=True, eq=False)
class RelativePoses:
    """n poses `T_earlier_current` (n x 4 x 4) with covariances (n x 6 x 6) between two stamps each (n, ns)."""

    stamps_earlier: Stamps
    stamps_current: Stamps
    T_earlier_current: Array
    covariances: Array

    @classmethod
    def of(cls, steps: "Iterable[tuple[Stamp, RelativePose]]") -> "RelativePoses":
        """Return the relative poses (`step` or `second`) of estimates, each with the stamp of its frame."""
        found = list(steps)
        return cls(
            np.array([relative.stamp_earlier for _, relative in found], dtype=np.int64),
            np.array([stamp for stamp, _ in found], dtype=np.int64),
            np.array([relative.T_earlier_current for _, relative in found]).reshape(-1, 4, 4),
            np.array([relative.covariance for _, relative in found]).reshape(-1, 6, 6),
        )

    def __len__(self) -> int:
        return len(self.stamps_current)


def read_relative(path: Path, beside: Trajectory | None = None) -> RelativePoses:
    """Read a file of relative poses; a last line cut short by a crash is left out.

    Where the clock leapt back, they are of the one time that lasts longest `beside` a trajectory. Raises
    SourceError naming the line that cannot be read.
    """
    stamps, values, _ = read_rows(path, f"a relative pose of {_FIELDS} fields", 2, _FIELDS - 2, may_be_cut=True)
    covariances = np.zeros((len(values), 6, 6))
    covariances[:, *np.triu_indices(6)] = values[:, 7:]
    covariances += np.triu(covariances, 1).transpose(0, 2, 1)
    now = of_one_time(stamps[:, 1], None if beside is None else beside.stamps)
    return RelativePoses(stamps[now, 0], stamps[now, 1], poses_of(path, values[now, :7]), covariances[now])


def relative_errors_of(poses: RelativePoses, truth: Trajectory, max_gap_s: float = 0.1) -> tuple[Array, Mask]:
    """Return the tangent errors `log(inv(T_estimate) T_true)` (m x 6) and which poses they belong to.

    Truth is that of the same body; a pose is left out when truth is missing at one of its two stamps.
    """
    earlier, valid_earlier = truth.at(poses.stamps_earlier, max_gap_s)
    current, valid_current = truth.at(poses.stamps_current, max_gap_s)
    valid = valid_earlier & valid_current
    T_true = se3.inverses(earlier[valid]) @ current[valid]
    return tangent_errors(poses.T_earlier_current[valid], T_true), valid


def relative_nees(poses: RelativePoses, truth: Trajectory, max_gap_s: float = 0.1) -> Nees:
    """Return the NEES of the relative poses whose two stamps both have truth (of the same body)."""
    errors, valid = relative_errors_of(poses, truth, max_gap_s)
    return nees(errors, poses.covariances[valid])
