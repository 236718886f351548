"""Trajectories as text files: TUM's format, tables that name their columns, KITTI's, and the folder of a run."""

import logging
import re
from pathlib import Path

import numpy as np

from odom.errors import SourceError
from odom.evaluation.pose_columns import PoseColumns, pose_columns
from odom.evaluation.times import Stamps, are_taken, leap_note, of_one_time
from odom.evaluation.trajectory import Trajectory
from odom.frame import seconds_text, stamp_of
from odom.geometry.arrays import Array
from odom.geometry.rotations import matrices_of, quaternions_of

log = logging.getLogger(__name__)

_ROTATION_TOLERANCE, _LENGTH_TOLERANCE = 1e-2, 0.1
"""How far a rotation matrix and a quaternion may be off by rounding: a wrong order of columns is off by far more."""
_SEGMENT = re.compile(r"#\s*segment\s+(-?\d{1,18})\s*$")


def read_rows(
    path: Path,
    what: str,
    stamps: int,
    values: int | None,
    *,
    may_be_cut: bool = False,
    columns: PoseColumns | None = None,
) -> tuple[Stamps, Array, list[int]]:
    """Return n x `stamps` (ns) and n x `values` numbers of a text file, and their line numbers; `#` starts a comment.

    Fields are parted by blanks, commas or semicolons, or are those that `columns` picks; what follows the stamps is
    skipped when `values` is None. `may_be_cut` leaves out a last line that is too short. Stamps are seconds, or by
    their number of digits milli-, micro- or nanoseconds, which is logged. Raises SourceError naming the line that is
    not `what`.
    """
    when, numbers, lines, units = [], [], [], set[str]()
    text = text_of(path).splitlines()
    for number, line in enumerate(text, 1):
        fields = line.split("#", 1)[0].replace(",", " ").replace(";", " ").split()
        is_short = values is not None and len(fields) < stamps + values
        if not fields or (columns and number <= columns.line):
            continue
        if may_be_cut and is_short and number == len(text):
            log.warning("%s: its last line has %d fields: left out as cut short", path, len(fields))
            continue
        try:
            fields = columns.pick(line) if columns else fields
            if values is not None and len(fields) != stamps + values:
                raise ValueError(f"{len(fields)} fields")
            read = [stamp_of(field) for field in fields[:stamps]]
            when.append([stamp for stamp, _ in read])
            units.update(unit for _, unit in read)
            numbers.append([float(field) for field in fields[stamps:]] if values is not None else [])
        except ValueError as error:
            raise SourceError(f"{path}:{number}: not {what} ({error})") from error
        lines.append(number)
    if other := sorted(units - {"seconds"}):
        log.info("%s: its stamps are taken for %s, by their number of digits", path, " and ".join(other))
    n = len(lines)
    return np.array(when, dtype=np.int64).reshape(n, stamps), np.array(numbers).reshape(n, values or 0), lines


def read_tum(path: str | Path, beside: Trajectory | None = None) -> Trajectory:
    """Read lines of `stamp tx ty tz qx qy qz qw` (seconds, metres); a comment `# segment N` begins a segment.

    Poses are returned as the file has them: those of a marker body (a run's `truth.txt` that begins with `# body NAME`)
    are carried to the camera by `odom.calibrate`. A line before them that names the columns says where each is
    (`pose_columns`): so EuRoC's CSV is read. A last line cut short by a crash is left out, and so are lost poses and
    those of another time than that `beside` a trajectory (`trajectory_of`). Raises SourceError naming the line that
    cannot be read.
    """
    path = Path(path)
    text = text_of(path)
    try:
        columns = pose_columns(text)
    except ValueError as error:
        raise SourceError(f"{path}: {error}") from None
    stamps, values, lines = read_rows(
        path, "a pose `stamp tx ty tz qx qy qz qw`", 1, 7, may_be_cut=True, columns=columns
    )
    marks = [(n, int(found[1])) for n, line in enumerate(text.splitlines(), 1) if (found := _SEGMENT.match(line))]
    begins, names = np.array([(0, 0), *marks]).T
    return trajectory_of(path, stamps, values, names[np.searchsorted(begins, lines) - 1], beside)


def read_run(folder: Path) -> Trajectory:
    """Read the corrected trajectory that `odom run` left in a folder, with the parts that were never joined to it.

    A clock that leapt back may have stamped two parts alike: then the larger one counts. Raises SourceError like
    `read_tum`.
    """
    whole = read_tum(folder / "trajectory.txt")
    others = [read_tum(path) for path in sorted(folder.glob("trajectory-segment-*.txt"))]
    if not others:
        return whole
    stamps, T, segment = whole.stamps, whole.T_world_body, np.zeros(len(whole), np.int64)
    for number, part in enumerate(sorted(others, key=len, reverse=True), 1):
        part = part.take(~are_taken(part.stamps, stamps))
        together = np.concatenate([stamps, part.stamps])
        order = np.argsort(together)
        stamps, T = together[order], np.concatenate([T, part.T_world_body])[order]
        segment = np.concatenate([segment, np.full(len(part), number)])[order]
    return Trajectory(stamps, T, segment)


def read_kitti(path: Path, times: Path) -> Trajectory:
    """Read twelve numbers a line (the upper 3 x 4 of `T_world_body`, row by row) and their `times`, a line each.

    Raises SourceError when a line cannot be read, the counts differ or a rotation is none.
    """
    P = read_rows(path, "a pose of twelve numbers", 0, 12)[1].reshape(-1, 3, 4)
    stamps = read_rows(times, "a time in seconds", 1, None)[0]
    if len(P) != len(stamps):
        raise SourceError(f"{path} has {len(P)} poses but {times} has {len(stamps)} times: give the poses' own times")
    known = np.isfinite(P).all(axis=(1, 2))
    R = P[known, :, :3]
    if not np.allclose(R @ R.transpose(0, 2, 1), np.eye(3), atol=_ROTATION_TOLERANCE):
        raise SourceError(f"{path}: the left 3 x 3 of a pose is not a rotation")
    quaternions = np.full((len(P), 4), np.nan)
    quaternions[known] = quaternions_of(R)
    return trajectory_of(path, stamps[:, 0], np.column_stack([P[:, :, 3], quaternions]))


def trajectory_of(
    path: Path, stamps: Stamps, values: Array, segments: Stamps | None = None, beside: Trajectory | None = None
) -> Trajectory:
    """Return the trajectory of n stamps (ns) and n x 7 values (see `poses_of`), sorted.

    What tools write for a camera that is lost, values that are not finite or a quaternion of zeros, is left out with a
    warning, and so are all poses of a stamp but the first, and where the clock leapt back those of another time than
    the one that lasts longest, `beside` a trajectory. Raises SourceError like `poses_of`.
    """
    stamps = stamps.reshape(-1)
    now = of_one_time(stamps, None if beside is None else beside.stamps)
    if note := leap_note(now):
        log.log(logging.WARNING if beside is None else logging.DEBUG, "%s: %s", path, note)
        stamps, values, segments = stamps[now], values[now], None if segments is None else segments[now]
    known = np.isfinite(values).all(axis=1) & (values[:, 3:] != 0.0).any(axis=1)
    if not known.all():
        log.warning(
            "%s: %d of %d poses are left out, as lost: they are not finite or their quaternion is zero",
            path, np.count_nonzero(~known), len(known),
        )  # fmt: skip
    unique, first = np.unique(stamps[known], return_index=True)
    kept = np.flatnonzero(known)[first]
    if (repeated := np.count_nonzero(known) - len(kept)) > 0:
        log.warning(
            "%s: %d of %d poses are left out, which have the stamp of another; stamps need all their digits",
            path, repeated, len(known),
        )  # fmt: skip
    T = poses_of(path, values[kept])
    several = segments is not None and len(set(segments[kept].tolist())) > 1
    return Trajectory(unique, T, segments[kept] if segments is not None and several else None)


def poses_of(path: Path, values: Array) -> Array:
    """Return n x 4 x 4 poses of n x 7 values `tx ty tz qx qy qz qw`, which were read from `path`.

    Raises SourceError naming the pose of which a value is not finite or the quaternion's length is not about one.
    """
    T = np.tile(np.eye(4), (len(values), 1, 1))
    if not len(values):
        return T
    lengths = np.linalg.norm(values[:, 3:], axis=1)
    good = np.isfinite(values).all(axis=1) & (np.abs(lengths - 1.0) <= _LENGTH_TOLERANCE)
    if not good.all():
        pose = " ".join(f"{value:g}" for value in values[np.argmin(good)])
        raise SourceError(f"{path}: {pose} is no pose x y z qx qy qz qw: not finite, or no quaternion of length one")
    T[:, :3, :3] = matrices_of(values[:, 3:])
    T[:, :3, 3] = values[:, :3]
    return T


def write_tum(path: str | Path, trajectory: Trajectory) -> None:
    """Write a trajectory as TUM text, stamps with nine decimals; `# segment N` stands where another segment begins."""
    quaternions = quaternions_of(trajectory.T_world_body[:, :3, :3])
    segments = np.zeros(len(trajectory), np.int64) if trajectory.segment is None else trajectory.segment
    begins = np.diff(segments, prepend=0) != 0
    with Path(path).open("w") as file:
        for k, (stamp, t, q) in enumerate(zip(trajectory.stamps, trajectory.positions, quaternions, strict=True)):
            if begins[k]:
                file.write(f"# segment {segments[k]}\n")
            file.write(f"{seconds_text(stamp)} " + " ".join(f"{value:.9f}" for value in (*t, *q)) + "\n")


def text_of(path: Path) -> str:
    """Return the content of a text file; raises SourceError when it cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise SourceError(f"{path} cannot be read: {error}") from error
