"""A trajectory: stamped poses of one body in one world, and its pose at any time between them."""

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import compress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.evaluation.times import Stamps, leap_note, of_one_time
from odom.frame import Stamp
from odom.frame.brief import brief
from odom.geometry.arrays import Array, Mask
from odom.geometry.rotations import matrices_of_vectors, vectors_of

if TYPE_CHECKING:
    from odom.backend import TrajectoryPose

_LOG = logging.getLogger(__name__)

_ROUNDED = 1e-6
"""How far the last row of a pose may be off 0 0 0 1 by rounding."""
_ROTATION_TOLERANCE = 1e-2
"""How far a rotation may be off by rounding."""


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """Poses `T_world_body` (n x 4 x 4, metres) at strictly increasing `stamps` (n, int64 nanoseconds).

    `segment` (n) numbers each pose's world: an estimate that was lost and began anew has several. None: just one.
    Lists are taken as well, arrays copied. Raises InputError when shapes disagree, stamps or segments are no integers,
    stamps do not increase, or a pose is not finite or its last row not 0 0 0 1, as that of a transposed one.
    """

    stamps: Stamps
    T_world_body: Array
    segment: Stamps | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        for name, kind in (("stamps", np.int64), ("T_world_body", np.float64), ("segment", np.int64)):
            if name != "segment" or self.segment is not None:
                object.__setattr__(self, name, as_array(name, getattr(self, name), kind))
        if self.stamps.dtype.kind != "i":
            raise InputError(f"stamps are {self.stamps.dtype}: give int64 nanoseconds, odom.from_seconds(...) of each")
        if self.stamps.ndim != 1 or self.T_world_body.shape != (len(self.stamps), 4, 4):
            raise InputError(f"{self.T_world_body.shape} poses for {self.stamps.shape} stamps: give n x 4 x 4 and n")
        if self.segment is not None and self.segment.dtype.kind != "i":
            raise InputError(f"segments are {self.segment.dtype}: give whole numbers, int64")
        if self.segment is not None and self.segment.shape != self.stamps.shape:
            raise InputError(f"{self.segment.shape} segments for {self.stamps.shape} stamps: give a number for each")
        if (np.diff(self.stamps) <= 0).any():
            raise InputError("the stamps of a trajectory must increase: sort the poses and drop repeated stamps")
        if not np.isfinite(self.T_world_body).all():
            raise InputError("a pose of the trajectory is not finite: drop it")
        wrong = (np.abs(self.T_world_body[:, 3] - (0.0, 0.0, 0.0, 1.0)) > _ROUNDED).any(axis=1)
        if wrong.any():
            row = " ".join(f"{value:g}" for value in self.T_world_body[np.argmax(wrong), 3])
            raise InputError(
                f"the last row of pose {np.argmax(wrong)} is {row}, not 0 0 0 1: where the translation stands there, "
                "the poses are transposed, give poses.transpose(0, 2, 1)"
            )

    @classmethod
    def of(cls, poses: "Iterable[TrajectoryPose]") -> "Trajectory":
        """Return the trajectory of the poses that `Odometry.finish` gives, without those where the camera was LOST.

        Where the clock leapt back by more than a second, so that moments come twice, those of the longest time without
        a leap.
        """
        found = [(pose.stamp, pose.T_map_camera, pose.segment) for pose in poses if pose.T_map_camera is not None]
        stamps, T, segments = zip(*found, strict=True) if found else ((), np.zeros((0, 4, 4)), ())
        all_stamps = np.array(stamps, dtype=np.int64)
        kept = of_one_time(all_stamps)
        if note := leap_note(kept):
            _LOG.warning("%s", note)
        return cls(all_stamps[kept], np.array(T)[kept], np.array(segments, dtype=np.int64)[kept])

    @classmethod
    def by_stamp(cls, T_world_body: Mapping[Stamp, Array], beside: "Trajectory | None" = None) -> "Trajectory":
        """Return the trajectory of poses (4 x 4) that are known by their stamps, in any order.

        They are of one time where the clock leapt back: of the one that lasts longest `beside` another trajectory.
        """
        given = list(T_world_body)
        stamps = sorted(compress(given, of_one_time(np.array(given), None if beside is None else beside.stamps)))
        return cls(np.array(stamps), np.array([T_world_body[at] for at in stamps]).reshape(-1, 4, 4))

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

    def take(self, index: Mask | NDArray[np.intp]) -> "Trajectory":
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

    @property
    def segment_count(self) -> int:
        """How many segments it has: one without any named, none without poses."""
        return min(1, len(self)) if self.segment is None else len(np.unique(self.segment))

    def longest_segment(self) -> "Trajectory":
        """Return the poses of the segment that has the most of them."""
        if self.segment is None:
            return self
        numbers, counts = np.unique(self.segment, return_counts=True)
        return self if len(numbers) < 2 else self.take(self.segment == numbers[np.argmax(counts)])

    def in_segments_of(self, other: "Trajectory") -> "Trajectory":
        """Return the trajectory with each pose given the segment of the latest pose of `other` that is not after it."""
        if other.segment is None:
            return replace(self, segment=None)
        index = np.searchsorted(other.stamps, self.stamps, side="right") - 1
        return replace(self, segment=other.segment[np.maximum(index, 0)])

    def at(self, stamps: Stamps, max_gap_s: float) -> tuple[Array, Mask]:
        """Return m x 4 x 4 poses interpolated at m stamps, and which of them are valid.

        Straight line and constant angular velocity between the two neighbours. A stamp outside the trajectory, or
        between neighbours more than `max_gap_s` apart, is not valid (its pose is NaN); nothing is extrapolated.
        """
        poses = np.full((len(stamps), 4, 4), np.nan)
        if len(self) < 2:
            exact = np.isin(stamps, self.stamps)
            poses[exact] = self.T_world_body
            return poses, exact
        right = np.clip(np.searchsorted(self.stamps, stamps), 1, len(self) - 1)
        left = right - 1
        gap = self.stamps[right] - self.stamps[left]
        fraction = (stamps - self.stamps[left]) / gap
        at_a_pose = (stamps == self.stamps[left]) | (stamps == self.stamps[right])
        valid = (stamps >= self.stamps[0]) & (stamps <= self.stamps[-1]) & ((gap <= max_gap_s * 1e9) | at_a_pose)
        if valid.any():
            w = fraction[valid, None]
            first, second = (self.T_world_body[side[valid], :3, :3] for side in (left, right))
            turn = vectors_of(first.transpose(0, 2, 1) @ second)
            poses[valid] = np.eye(4)
            poses[valid, :3, :3] = first @ matrices_of_vectors(w * turn)
            poses[valid, :3, 3] = (1 - w) * self.positions[left[valid]] + w * self.positions[right[valid]]
        return poses, valid


def check(name: str, given: Any) -> None:
    """Raise InputError, calling what is given `name`, unless it is a trajectory and all of its poses rigid motions."""
    if not isinstance(given, Trajectory):
        raise InputError(
            f"{name} is a {type(given).__name__}: give an odom.Trajectory of stamps and poses, or odom.read_tum(path)"
        )
    wrong = ~have_rotations(given.T_world_body)
    if wrong.any():
        raise InputError(
            f"{name}: {wrong.sum()} of {len(given)} poses are no rigid motions, at first pose {np.argmax(wrong)}: the "
            "upper left 3 x 3 of each must be a rotation, neither scaled nor mirrored"
        )


def have_rotations(T: Array) -> Mask:
    """Return of which poses (n x 4 x 4) the upper left 3 x 3 is a rotation, but for rounding."""
    R = T[:, :3, :3]
    away = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3))
    return np.asarray((away <= _ROTATION_TOLERANCE).all(axis=(1, 2)) & (np.linalg.det(R) > 0.0))


def as_array(name: str, values: Any, kind: type[np.generic]) -> NDArray[Any]:
    """Return a copy of numbers as an array of `kind`, or of the kind that `values` have where that would change them.

    Raises InputError, calling them `name`, for what are no numbers, or some of them masked.
    """
    try:
        if np.ma.isMaskedArray(values):
            raise ValueError("some are masked: leave these out")
        array = np.array(values)
        if not array.size or np.can_cast(array.dtype, kind, "safe"):
            return array.astype(kind, copy=False)
        if kind is not np.int64:
            raise ValueError(f"numbers of type {array.dtype}")
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is no array of numbers ({error}): give one of numpy") from error
    return array


def nearest(stamps: Stamps, goals: Stamps) -> NDArray[np.intp]:
    """Return the index of the nearest of at least two increasing stamps to each goal; the later one of equally near."""
    right = np.clip(np.searchsorted(stamps, goals), 1, len(stamps) - 1)
    return np.where(goals - stamps[right - 1] < stamps[right] - goals, right - 1, right)
