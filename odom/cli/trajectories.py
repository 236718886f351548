"""Trajectories for `odom eval`, whatever kind of file they are in."""

import json
import logging
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from odom.errors import SourceError, WireError
from odom.evaluation.files import read_kitti, read_run, read_tum
from odom.evaluation.motive import is_motive, read_motive
from odom.evaluation.run_report import CAMERA, body_of
from odom.evaluation.trajectory import Trajectory
from odom.frame import Stamp
from odom.wire.recording import is_recording

_LOG = logging.getLogger(__name__)
_TRUTH = "truth/"


def read_estimate(path: Path, *, times: Path | None, topic: str) -> Trajectory:
    """Return the estimate in a TUM or KITTI file, a recording's topic, or a folder that `odom run` left."""
    if path.is_dir() and (path / "trajectory.txt").is_file():
        return read_run(path)
    if is_recording(path):
        return _from_recording(path, topic)[0]
    if path.is_dir():
        raise SourceError(
            f"{path} holds no trajectory.txt: it is no run's, or the run was stopped before it was saved. "
            "Give the poses as published, odometry.txt, if they are there"
        )
    return _text(path, times)


def frames_of_run(path: Path) -> int | None:
    """Return how many frames the source of a run in a folder had, LOST ones too; None where its report does not say."""
    try:
        report = json.loads((path / "report.json").read_text())
        return int(report.get("total") or report["frames"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def read_truth(
    path: Path, *, times: Path | None, topic: str | None, body: str | None, y_up: bool, of_run: bool
) -> tuple[Trajectory, bool]:
    """Return the truth, and whether it is of a marker body by another clock rather than of the camera.

    Text is of the body that its first line names (see `body_of`).
    """
    if path.is_dir() and (path / "truth.txt").is_file():
        path = path / "truth.txt"
    elif of_run and not is_recording(path):
        raise SourceError(f"{path} holds no truth.txt: give the truth as second argument")
    if path.suffix.lower() == ".csv" and is_motive(path):
        return read_motive(path, body, y_up), True
    if is_recording(path):
        trajectory, found = _from_recording(path, topic)
        return trajectory, found.startswith(_TRUTH) and found != f"{_TRUTH}{CAMERA}/pose"
    return _text(path, times), body_of(path) != CAMERA


def read_claims(path: Path, *, topic: str) -> "dict[Stamp, NDArray[np.float64]]":
    """Return the 6 x 6 covariance of each pose that a recording's odometry gives: of `topic`, or of the one beside it.

    Nothing where ESTIMATE is no recording, or where its odometry claims none. A pose that is exact by definition, as
    the first of a segment, is left out.
    """
    if path.is_dir() or not is_recording(path):
        return {}
    from odom.wire.codec import decode_odometry
    from odom.wire.recording import open_reader

    reader, wanted = open_reader(path), topic.removeprefix("/")
    names = {stream.topic for stream in reader.streams() if stream.type_name == "nav_msgs/msg/Odometry"}
    name = wanted if wanted in names else f"{wanted.rpartition('/')[0]}/odom"
    claims = {}
    for message in reader.messages({name}) if name in names else ():
        try:
            pose = decode_odometry(message)
        except WireError:
            continue  # told where the poses are read
        if pose.covariance is not None and np.linalg.eigvalsh(pose.covariance)[0] > 0.0:
            claims[pose.stamp] = pose.covariance
    return claims


def _text(path: Path, times: Path | None) -> Trajectory:
    if _columns(path) != 12:
        return read_tum(path)
    if times is None:
        raise SourceError(f"{path} looks like KITTI poses, which have no stamps: give --times")
    return read_kitti(path, times)


def _columns(path: Path) -> int:
    """Return the number of fields of the first line that is no comment; 0 when there is none."""
    try:
        with path.open() as file:
            for line in file:
                fields = line.split("#", 1)[0].replace(",", " ").split()
                if fields:
                    return len(fields)
    except (OSError, UnicodeDecodeError) as error:
        raise SourceError(f"{path} cannot be read: {error}") from error
    return 0


def _from_recording(path: Path, topic: str | None) -> tuple[Trajectory, str]:
    """Return the poses of a topic, the one below `truth/` when None, and the topic's name; what is no pose is told."""
    from odom.wire.codec import cdr, decode_any_pose, decode_path
    from odom.wire.recording import open_reader

    reader = open_reader(path)
    streams = {stream.topic: stream for stream in reader.streams() if stream.type_name in (*cdr.POSES, cdr.PATH)}
    if topic is None:
        truths = [name for name in streams if name.startswith(_TRUTH)]
        if len(truths) == 1:
            topic = truths[0]
    name = topic.removeprefix("/") if topic else None
    if name not in streams:
        raise SourceError(
            f"{path}: name the topic with --topic or --truth-topic; those with poses: {', '.join(streams) or 'none'}"
        )
    is_path = streams[name].type_name == cdr.PATH
    poses: dict[Stamp, NDArray[np.float64]] = {}
    left_out: list[WireError] = []
    for message in reader.messages({name}):
        try:
            found = decode_path(message) if is_path else (decode_any_pose(message),)
        except WireError as error:
            left_out.append(error)
            continue
        if is_path:  # each holds all poses so far
            poses.clear()
        poses.update({pose.stamp: pose.T_parent_child for pose in found})
    if left_out:
        _LOG.warning("%s: %d messages of /%s are left out, such as: %s", path, len(left_out), name, left_out[0])
    return Trajectory.by_stamp(poses), name
