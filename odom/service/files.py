"""The files of a run, written pose by pose so that kill -9 loses at most the last line."""

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from odom.backend import Estimate, RelativePose, TrajectoryPose
from odom.frame import Stamp
from odom.service import earlier
from odom.wire.codec import quaternion_from_rotation

Array = NDArray[np.float64]

_UPPER = np.triu_indices(6)
_FULL_BYTES = 1 << 30


def pose_line(stamp: Stamp, T: Array) -> str:
    """Return the TUM line `stamp tx ty tz qx qy qz qw` (seconds, metres)."""
    values = (*T[:3, 3], *quaternion_from_rotation(T[:3, :3]))
    return f"{_seconds(stamp)} " + " ".join(f"{value:.9f}" for value in values) + "\n"


def relative_line(stamp: Stamp, relative: RelativePose) -> str:
    """Return `stamp_earlier stamp_current tx ty tz qx qy qz qw c00 c01 .. c55`, 21 entries of the covariance."""
    covariance = " ".join(f"{value:.9e}" for value in relative.covariance[_UPPER])
    pose = pose_line(stamp, relative.T_earlier_current).rstrip("\n")
    return f"{_seconds(relative.stamp_earlier)} {pose} {covariance}\n"


class LineFile:
    """A file of whole lines: each is in the hands of the system when `write` returns, and left out when it raises."""

    def __init__(self, path: Path, first: str = "") -> None:
        self.size = 0
        self._file = path.open("wb", buffering=0)
        self.write(first)

    def write(self, line: str) -> None:
        """Append a line; raises OSError when it finds no room, the file being then as it was before."""
        left = line.encode("ascii")
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError:
            self._file.seek(self.size)
            self._file.truncate()
            raise
        self.size += len(line)

    def close(self) -> None:
        """Close the file; safe to call twice."""
        self._file.close()


class RunFiles:
    """The text files in the folder of a run; every line is in the hands of the system when `append` returns.

    Raises OSError when the folder cannot be written; what is in the files by then are whole lines. With `chain` the
    paper's pairwise poses go to `chain.txt`, chained from the first frame on; a frame without one leaves a comment
    there and the chain goes on behind it.
    Results of an earlier run in the folder are removed, or with `keep_earlier` set aside (see `earlier`): a service
    that is started again after a crash has not lost what it wrote before. Its own it sets aside, too, at each GiB.
    """

    def __init__(self, folder: Path, chain: bool = False, keep_earlier: bool = False) -> None:
        self.folder = folder
        self._keep_earlier = keep_earlier
        folder.mkdir(parents=True, exist_ok=True)
        if keep_earlier:
            earlier.set_aside(folder)
        else:
            earlier.remove(folder)
        names = ("odometry.txt", "relative_step.txt", "relative_second.txt", *(("chain.txt",) if chain else ()))
        self._files = {name: LineFile(folder / name) for name in names}
        self._T_chain: Array = np.eye(4)
        self._truth: dict[str, str] = {}

    def append(self, estimate: Estimate) -> None:
        """Write what the estimate says of its frame; a LOST frame leaves no line."""
        if estimate.pairwise is not None:
            self._T_chain = self._T_chain @ estimate.pairwise.T_earlier_current
        self._begin_anew_if_full()
        if estimate.T_odom_camera is not None:
            self._files["odometry.txt"].write(pose_line(estimate.stamp, estimate.T_odom_camera))
        if estimate.step is not None:
            self._files["relative_step.txt"].write(relative_line(estimate.stamp, estimate.step))
        if estimate.second is not None:
            self._files["relative_second.txt"].write(relative_line(estimate.stamp, estimate.second))
        if "chain.txt" in self._files:
            broken = estimate.pairwise is None and estimate.sequence
            comment = f"# {_seconds(estimate.stamp)}: no pairwise pose\n" if broken else ""
            self._files["chain.txt"].write(comment + pose_line(estimate.stamp, self._T_chain))

    def append_truth(self, body: str, stamp: Stamp, T_world_body: Array) -> None:
        """Write a motion capture pose: the first body seen to `truth.txt`, others to `truth_<body>.txt`."""
        self._begin_anew_if_full()
        name = self._truth.get(body)
        if name is None:
            name = f"truth_{body}.txt" if self._truth else "truth.txt"
            self._files[name] = LineFile(self.folder / name, _truth_mark(body))
            self._truth[body] = name
        self._files[name].write(pose_line(stamp, T_world_body))

    def write_trajectory(self, poses: Iterable[TrajectoryPose]) -> None:
        """Write the final corrected trajectory, replacing an earlier one at once; a comment begins each segment."""
        segment = None
        with _whole(self.folder / "trajectory.txt") as file:
            for pose in poses:
                if pose.T_map_camera is None:
                    continue
                if pose.segment != segment:
                    segment = pose.segment
                    file.write(f"# segment {segment}\n")
                file.write(pose_line(pose.stamp, pose.T_map_camera))

    def close(self) -> None:
        """Close the files; safe to call twice."""
        for file in self._files.values():
            file.close()

    def _begin_anew_if_full(self) -> None:
        """Set the files of a service aside, whole as they are, and begin new ones before they outgrow a disk."""
        if not self._keep_earlier or sum(file.size for file in self._files.values()) < _FULL_BYTES:
            return
        marks = {name: _truth_mark(body) for body, name in self._truth.items()}
        earlier.set_aside(self.folder)
        fresh = {name: LineFile(self.folder / name, marks.get(name, "")) for name in self._files}
        self.close()
        self._files = fresh


def write_json(path: Path, content: Mapping[str, object]) -> None:
    """Write a JSON file that is either whole or as it was before; raises OSError when it cannot be written."""
    with _whole(path) as file:
        file.write(json.dumps(content, indent=2) + "\n")


@contextmanager
def _whole(path: Path) -> Iterator[TextIO]:
    """Open a file that takes the place of `path` once all is written."""
    partial = path.with_name(f"{path.name}.part")
    try:
        with partial.open("w", encoding="ascii") as file:
            yield file
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def _truth_mark(body: str) -> str:
    return f"{earlier.TRUTH_MARK}{body}\n"


def _seconds(stamp: Stamp) -> str:
    return f"{stamp // 1_000_000_000}.{stamp % 1_000_000_000:09d}"
