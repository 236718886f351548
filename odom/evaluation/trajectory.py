"""A trajectory: stamped poses of one body in one world, and its pose at any time between them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from odom.errors import InputError

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses `T_world_body` (n x 4 x 4, metres) at strictly increasing `stamps` (n, int64 nanoseconds).

    `segment` (n) numbers worlds of their own, where an estimate was lost and begun anew; None when there is but one.
    Raises InputError when shapes disagree, stamps do not increase or a pose is not finite.
    """

    stamps: Stamps
    T_world_body: Array
    segment: Stamps | None = None

    def __post_init__(self) -> None:
        if self.stamps.ndim != 1 or self.T_world_body.shape != (len(self.stamps), 4, 4):
            raise InputError(f"{self.T_world_body.shape} poses for {self.stamps.shape} stamps: give n x 4 x 4 and n")
        if (np.diff(self.stamps) <= 0).any():
            raise InputError("the stamps of a trajectory must increase: sort the poses and drop repeated stamps")
        if not np.isfinite(self.T_world_body).all():
            raise InputError("a pose of the trajectory is not finite: drop it")

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def positions(self) -> Array:
        """Positions of the body in the world, n x 3 metres."""
        return self.T_world_body[:, :3, 3]

    @property
    def duration_s(self) -> float:
        """Seconds from the first pose to the last."""
        return float(self.stamps[-1] - self.stamps[0]) * 1e-9 if len(self) else 0.0

    @property
    def length_m(self) -> float:
        """Metres travelled."""
        return float(np.linalg.norm(np.diff(self.positions, axis=0), axis=1).sum())

    def take(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> "Trajectory":
        """Return the poses chosen by a mask or by increasing indices."""
        segment = None if self.segment is None else self.segment[index]
        return Trajectory(self.stamps[index], self.T_world_body[index], segment)

    def moved(self, T_new_world: Array) -> "Trajectory":
        """Return the trajectory expressed in another world frame."""
        return replace(self, T_world_body=T_new_world @ self.T_world_body)

    def of_body(self, T_body_other: Array) -> "Trajectory":
        """Return the trajectory of another body fixed to this one."""
        return replace(self, T_world_body=self.T_world_body @ T_body_other)

    def delayed(self, seconds: float) -> "Trajectory":
        """Return the trajectory with `seconds` added to every stamp."""
        return replace(self, stamps=self.stamps + np.int64(round(seconds * 1e9)))

    def longest_segment(self) -> "Trajectory":
        """Return the poses of the segment that has the most of them."""
        if self.segment is None:
            return self
        numbers, counts = np.unique(self.segment, return_counts=True)
        return self if len(numbers) < 2 else self.take(self.segment == numbers[np.argmax(counts)])

    def in_segments_of(self, other: "Trajectory") -> "Trajectory":
        """Return the trajectory with the segments of `other`: a pose is in that of the last one not after it."""
        if other.segment is None:
            return self
        index = np.searchsorted(other.stamps, self.stamps, side="right") - 1
        return replace(self, segment=other.segment[np.maximum(index, 0)])

    def at(self, stamps: Stamps, max_gap_s: float) -> tuple[Array, NDArray[np.bool_]]:
        """Return m x 4 x 4 poses interpolated at m stamps, and which of them are valid.

        Straight line and constant angular velocity between the two neighbours. A stamp outside the trajectory, or
        between neighbours more than `max_gap_s` apart, is not valid (its pose is NaN); nothing is extrapolated.
        """
        poses = np.full((len(stamps), 4, 4), np.nan)
        if not len(self):
            return poses, np.zeros(len(stamps), dtype=bool)
        right = np.clip(np.searchsorted(self.stamps, stamps), 1, max(len(self) - 1, 1))
        left = right - 1
        if len(self) == 1:
            exact = stamps == self.stamps[0]
            poses[exact] = self.T_world_body[0]
            return poses, exact
        gap = self.stamps[right] - self.stamps[left]
        fraction = (stamps - self.stamps[left]) / gap
        at_a_pose = (stamps == self.stamps[left]) | (stamps == self.stamps[right])
        valid = (stamps >= self.stamps[0]) & (stamps <= self.stamps[-1]) & ((gap <= max_gap_s * 1e9) | at_a_pose)
        if valid.any():
            w = fraction[valid, None]
            first = Rotation.from_matrix(self.T_world_body[left[valid], :3, :3])
            turn = first.inv() * Rotation.from_matrix(self.T_world_body[right[valid], :3, :3])
            poses[valid] = np.eye(4)
            poses[valid, :3, :3] = (first * Rotation.from_rotvec(w * turn.as_rotvec())).as_matrix()
            poses[valid, :3, 3] = (1 - w) * self.positions[left[valid]] + w * self.positions[right[valid]]
        return poses, valid


def inverse_all(T: Array) -> Array:
    """Return the inverses of n rigid motions (n x 4 x 4)."""
    out = np.zeros_like(T)
    out[:, :3, :3] = T[:, :3, :3].transpose(0, 2, 1)
    out[:, :3, 3] = -np.einsum("nji,nj->ni", T[:, :3, :3], T[:, :3, 3])
    out[:, 3, 3] = 1.0
    return out


def angles(R: Array) -> Array:
    """Return the rotation angles (n, radians) of n rotation matrices (n x 3 x 3)."""
    return np.asarray(Rotation.from_matrix(R).magnitude()) if len(R) else np.zeros(0)
