"""The files of a run, written pose by pose so that kill -9 loses at most the last line."""

from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from odom.backend import Estimate, RelativePose, TrajectoryPose
from odom.frame import Stamp
from odom.wire.codec import quaternion_from_rotation

Array = NDArray[np.float64]

_UPPER = np.triu_indices(6)
_RESULTS = (
    "odometry.txt",
    "trajectory.txt",
    "relative_step.txt",
    "relative_second.txt",
    "chain.txt",
    "truth.txt",
    "report.json",
    "plot.png",
    "session.rrd",
)


def pose_line(stamp: Stamp, T: Array) -> str:
    """Return the TUM line `stamp tx ty tz qx qy qz qw` (seconds, metres)."""
    values = (*T[:3, 3], *quaternion_from_rotation(T[:3, :3]))
    return f"{_seconds(stamp)} " + " ".join(f"{value:.9f}" for value in values) + "\n"


def relative_line(stamp: Stamp, relative: RelativePose) -> str:
    """Return `stamp_earlier stamp_current tx ty tz qx qy qz qw c00 c01 .. c55`, 21 entries of the covariance."""
    covariance = " ".join(f"{value:.9e}" for value in relative.covariance[_UPPER])
    pose = pose_line(stamp, relative.T_earlier_current).rstrip("\n")
    return f"{_seconds(relative.stamp_earlier)} {pose} {covariance}\n"


class RunFiles:
    """The text files in the folder of a run; every line is in the hands of the system when `append` returns.

    Raises OSError when the folder cannot be written. With `chain` the paper's pairwise poses go to `chain.txt`,
    chained from the first frame on; a frame without one leaves a comment there and the chain goes on behind it.
    Results of an earlier run in the folder are removed, or with `keep_earlier` moved into a subfolder of it: a service
    that is started again after a crash has not lost what it wrote before.
    """

    def __init__(self, folder: Path, chain: bool = False, keep_earlier: bool = False) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        _clear(folder, keep_earlier)
        self._odometry = self._open("odometry.txt")
        self._step = self._open("relative_step.txt")
        self._second = self._open("relative_second.txt")
        self._chain = self._open("chain.txt") if chain else None
        self._T_chain: Array = np.eye(4)
        self._truth: dict[str, TextIO] = {}

    def append(self, estimate: Estimate) -> None:
        """Write what the estimate says of its frame; a LOST frame leaves no line."""
        if estimate.T_odom_camera is not None:
            self._odometry.write(pose_line(estimate.stamp, estimate.T_odom_camera))
        if estimate.step is not None:
            self._step.write(relative_line(estimate.stamp, estimate.step))
        if estimate.second is not None:
            self._second.write(relative_line(estimate.stamp, estimate.second))
        if self._chain is not None:
            if estimate.pairwise is not None:
                self._T_chain = self._T_chain @ estimate.pairwise.T_earlier_current
            elif estimate.sequence:
                self._chain.write(f"# {_seconds(estimate.stamp)}: no pairwise pose\n")
            self._chain.write(pose_line(estimate.stamp, self._T_chain))

    def append_truth(self, body: str, stamp: Stamp, T_world_body: Array) -> None:
        """Write a motion capture pose: the first body seen to `truth.txt`, others to `truth_<body>.txt`."""
        if body not in self._truth:
            self._truth[body] = self._open(f"truth_{body}.txt" if self._truth else "truth.txt")
            self._truth[body].write(f"# body {body}\n")
            self._truth[body].write(f"# body {body}\n")
        self._truth[body].write(pose_line(stamp, T_world_body))

    def write_trajectory(self, poses: Iterable[TrajectoryPose]) -> None:
        """Write the final corrected trajectory, replacing an earlier one at once; a comment begins each segment."""
        partial = self.folder / "trajectory.txt.part"
        segment = None
        with partial.open("w", encoding="ascii") as file:
            for pose in poses:
                if pose.T_map_camera is None:
                    continue
                if pose.segment != segment:
                    segment = pose.segment
                    file.write(f"# segment {segment}\n")
                file.write(pose_line(pose.stamp, pose.T_map_camera))
        partial.replace(self.folder / "trajectory.txt")

    def close(self) -> None:
        """Close the files; safe to call twice."""
        for file in (self._odometry, self._step, self._second, self._chain, *self._truth.values()):
            if file is not None:
                file.close()

    def _open(self, name: str) -> TextIO:
        return (self.folder / name).open("w", encoding="ascii", buffering=1)


def _seconds(stamp: Stamp) -> str:
    return f"{stamp // 1_000_000_000}.{stamp % 1_000_000_000:09d}"


def _clear(folder: Path, keep_earlier: bool) -> None:
    earlier = [folder / name for name in _RESULTS if (folder / name).is_file()]
    written = max((path.stat().st_mtime for path in earlier), default=0.0)
    if not keep_earlier or not earlier:
        for path in earlier:
            path.unlink()
        return
    name = datetime.fromtimestamp(written, UTC).strftime("until-%Y%m%dT%H%M%SZ")
    place = folder / name
    for i in range(2, 1000):
        if not place.exists():
            break
        place = folder / f"{name}-{i}"
    place.mkdir()
    for path in earlier:
        path.rename(place / path.name)
