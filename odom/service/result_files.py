"""The files of a run, written pose by pose so that kill -9 loses at most the last line."""

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import TextIO

import numpy as np

from odom.backend import ClosedChain, Estimate, RelativePose, TrajectoryPose
from odom.errors import replacing
from odom.frame import Stamp, from_seconds, seconds_text
from odom.geometry.arrays import Array
from odom.geometry.quaternion import quaternion_from_rotation, rotation_from_quaternion
from odom.service import previous_results

_UPPER = np.triu_indices(6)
"""The upper triangle of a covariance: the rest repeats it."""
_POSE_LINE, _COVARIANCE = "%s" + " %.9f" * 7 + "\n", " ".join(["%.9e"] * 21)
"""A line of TUM's format (to nanometres), and the triangle (ten digits)."""
_FULL_BYTES = 1 << 30
"""A service begins new files after so many bytes, some six hours: larger files no longer fit into a reader's memory."""


def pose_line(stamp: Stamp, T: Array) -> str:
    """Return the TUM line `stamp tx ty tz qx qy qz qw` (seconds, metres)."""
    values = (*T[:3, 3].tolist(), *quaternion_from_rotation(T[:3, :3]).tolist())
    return _POSE_LINE % (seconds_text(stamp), *values)


def relative_line(stamp: Stamp, relative: RelativePose) -> str:
    """Return `stamp_earlier stamp_current tx ty tz qx qy qz qw c00 c01 .. c55`: the covariance's upper triangle."""
    covariance = _COVARIANCE % tuple(relative.covariance[_UPPER].tolist())
    pose = pose_line(stamp, relative.T_earlier_current).rstrip("\n")
    return f"{seconds_text(relative.stamp_earlier)} {pose} {covariance}\n"


class Continuity:
    """Numbers the stretches of causal poses that share one coordinate system, and says where continuity ends.

    The odometry's segment numbers do not tell this: when two segments are joined, poses published before stay as they
    are.
    """

    def __init__(self) -> None:
        self._segment: int | None = None
        self._numbers: dict[int, int] = {}
        self._begun = 0
        self._is_lost = False

    def comment(self, estimate: Estimate) -> str:
        """Return the comment lines to stand before a frame's pose, empty where it continues the one before."""
        if estimate.T_odom_camera is None:
            self._is_lost = self._segment is not None
            return ""
        was, is_lost = self._segment, self._is_lost
        self._segment, self._is_lost = estimate.segment, False
        if estimate.segment not in self._numbers:
            self._numbers[estimate.segment] = self._begun
            self._begun += 1
            if was is None:
                return ""
            why = "a new segment begins at the last known pose"
        elif is_lost:
            why = "LOST before; found again in the map"
        else:
            if was is not None and was != estimate.segment:  # joined: poses go on as they were
                self._numbers[estimate.segment] = self._numbers.pop(was)
            return ""
        return f"# continuity ends: {why}\n# segment {self._numbers[estimate.segment]}\n"


class LineFile:
    """A file of whole lines: each is handed to the system when `write` returns, and left out when it raises."""

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
    """The text files in the folder of a run; every line is handed to the system when `append` returns.

    Raises OSError when the folder cannot be written; what is in the files by then are whole lines. The paper's chain
    goes to `chain.txt`, its links to `relative_chain.txt`; a frame that could not be linked to an earlier one follows a
    comment with the reason, and the chain goes on from its last pose. Results of an earlier run in the folder are set
    aside (see `previous_results`). An `endless` service also sets its own results aside after each GiB, and finally
    drops the oldest.
    """

    def __init__(self, folder: Path, endless: bool = False) -> None:
        self.folder = folder
        self._endless = endless
        folder.mkdir(parents=True, exist_ok=True)
        self._set_aside()
        names = ("odometry.txt", "relative_step.txt", "relative_second.txt", "chain.txt", "relative_chain.txt")
        self._files = {name: LineFile(folder / name) for name in names}
        self._truth: dict[str, str] = {}
        self._continuity = Continuity()
        self._comment = ""  # until a pose could be written after it

    def append(self, estimate: Estimate) -> None:
        """Write a frame's poses; a LOST frame leaves no line."""
        self._begin_anew_if_full()
        self._comment = self._continuity.comment(estimate) or self._comment
        if estimate.T_odom_camera is not None:
            self._files["odometry.txt"].write(self._comment + pose_line(estimate.stamp, estimate.T_odom_camera))
            self._comment = ""
        if estimate.step is not None:
            self._files["relative_step.txt"].write(relative_line(estimate.stamp, estimate.step))
        if estimate.second is not None:
            self._files["relative_second.txt"].write(relative_line(estimate.stamp, estimate.second))
        if (chain := estimate.chain) is not None:
            hole = f"# {seconds_text(estimate.stamp)}: a hole: {chain.hole}\n" if chain.hole else ""
            self._files["chain.txt"].write(hole + pose_line(estimate.stamp, chain.T_chain_camera))
        if estimate.pairwise is not None:
            self._files["relative_chain.txt"].write(relative_line(estimate.stamp, estimate.pairwise))

    def append_truth(self, body: str, stamp: Stamp, T_world_body: Array) -> None:
        """Write a motion capture pose: the first body seen to `truth.txt`, others to `truth_<body>.txt`."""
        self._begin_anew_if_full()
        name = self._truth.get(body)
        if name is None:
            name = f"truth_{body}.txt" if self._truth else "truth.txt"
            self._files[name] = LineFile(self.folder / name, _truth_mark(body))
            self._truth[body] = name
        self._files[name].write(pose_line(stamp, T_world_body))

    def write_trajectory(
        self, poses: Iterable[TrajectoryPose], closed: ClosedChain | None = None
    ) -> list[dict[str, object]]:
        """Write the final corrected trajectory, each file replaced at once; return its parts, the largest first.

        A part is what was joined by recognised places: the one with most frames goes to `trajectory.txt`, every other
        one to `trajectory-segment-N.txt`, in a coordinate system of its own. Beside it goes the `closed` chain.
        """
        if closed is not None:
            self._write_closed_chain(closed)
        lines: dict[int, list[str]] = {}
        for pose in poses:
            if pose.T_map_camera is not None:
                lines.setdefault(pose.segment, []).append(pose_line(pose.stamp, pose.T_map_camera))
        parts = sorted(lines, key=lambda segment: (-len(lines[segment]), segment))
        names = ["trajectory.txt", *(f"trajectory-segment-{segment}.txt" for segment in parts[1:])]
        remark = (
            f"# the largest of {len(parts)} parts that were never joined, {len(lines[parts[0]])} of "
            f"{sum(map(len, lines.values()))} poses; the others are in trajectory-segment-N.txt\n"
            if len(parts) > 1
            else ""
        )
        for stale in set(self.folder.glob(previous_results.OTHER_PARTS)) - {self.folder / name for name in names}:
            stale.unlink()
        for name, segment in zip(names, parts or [0], strict=True):
            with whole_file(self.folder / name) as file:
                file.write(f"# segment {segment}\n" if parts else "")
                file.write(remark if name == names[0] else "# never joined to trajectory.txt\n")
                file.writelines(lines.get(segment, ()))
        return [
            {"segment": segment, "frames": len(lines[segment]), "file": name}
            for segment, name in zip(parts, names, strict=False)
        ]

    def _write_closed_chain(self, closed: ClosedChain) -> None:
        """Write `chain_closed.txt`: the poses of `chain.txt` as its closures move them."""
        with (self.folder / "chain.txt").open() as chain, whole_file(self.folder / "chain_closed.txt") as file:
            stamps = (from_seconds(line.split()[0]) for line in chain if not line.startswith("#"))
            steps_back, last = sum(a >= b for a, b in pairwise(stamps)), None
            chain.seek(0)
            for line in chain:
                if line.startswith("#"):
                    file.write(line)
                    continue
                stamp, T = _pose_of(line)
                steps_back -= last is not None and stamp <= last
                last = stamp
                file.write(pose_line(stamp, closed.moved(stamp, T, steps_back)))

    def close(self) -> None:
        """Close the files; safe to call twice."""
        for file in self._files.values():
            file.close()

    def _begin_anew_if_full(self) -> None:
        """Set the files of a service aside and begin new ones when they are full."""
        if not self._endless or sum(file.size for file in self._files.values()) < _FULL_BYTES:
            return
        marks = {name: _truth_mark(body) for body, name in self._truth.items()}
        self._set_aside()
        fresh = {name: LineFile(self.folder / name, marks.get(name, "")) for name in self._files}
        self.close()
        self._files = fresh

    def _set_aside(self) -> None:
        previous_results.set_aside(self.folder)
        if self._endless:
            previous_results.drop_oldest(self.folder)


def write_json(path: Path, content: Mapping[str, object]) -> None:
    """Write a JSON file that is either whole or as it was before; raises OSError when it cannot be written."""
    with whole_file(path) as file:
        file.write(json.dumps(content, indent=2) + "\n")


@contextmanager
def whole_file(path: Path) -> Iterator[TextIO]:
    """Open a file that replaces `path` once all is written; raises OSError, and leaves `path` as it was."""
    with replacing(path) as part, part.open("w", encoding="utf-8") as file:
        yield file


def _pose_of(line: str) -> tuple[Stamp, Array]:
    """Return the stamp and the pose of a line of `pose_line`."""
    time, *numbers = line.split()
    T, values = np.eye(4), np.array([float(x) for x in numbers])
    T[:3, 3], T[:3, :3] = values[:3], rotation_from_quaternion(values[3:])
    return from_seconds(time), T


def _truth_mark(body: str) -> str:
    return f"{previous_results.TRUTH_MARK}{body}\n"
