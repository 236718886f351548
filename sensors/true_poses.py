"""True poses of folders of images, from files of matrices: one a pose, or one for all images in their order."""

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from odom.errors import InputError, SourceError
from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.geometry.quaternion import quaternion_from_rotation
from sensors.image_lists import TumEntry, as_frames, counts_frames, is_of_frame, read_list, stamp_of_frame
from sensors.image_names import visible

log = logging.getLogger(__name__)

THE_CAMERAS_OWN = np.eye(4)
"""`T_body_camera` of true poses that are the colour camera's."""
_HEAD, _MATRIX, _ROWS = 3, 16, 12
"""Numbers of a pose in Open3D's `trajectory.log`, those of frames before those of its matrix; and in SUN3D's, which
lacks the last row."""


def poses_in(folder: Path, files: Sequence[TumEntry], T_body_camera: Array = THE_CAMERAS_OWN) -> list[TumEntry]:
    """Return the camera's poses from files with one of its body each, without those that were lost (infinities).

    Files that hold no matrix of 4 x 4 numbers are left out, counted and told.
    """
    poses, wrong = list[TumEntry](), list[Path]()
    for entry in files:
        try:
            T_world_body = np.loadtxt(folder / entry.values[0]).reshape(4, 4)
        except (OSError, ValueError):
            wrong.append(folder / entry.values[0])
            continue
        if np.isfinite(T_world_body).all():
            poses += true_pose(entry.stamp, T_world_body @ T_body_camera)
    if wrong:
        log.warning(
            "%s: %d of %d true poses are left out, as %s: give a matrix T_world_camera of 4 x 4 numbers a file",
            folder, len(wrong), len(files), wrong[0],
        )  # fmt: skip
    return poses


def true_pose(stamp: Stamp, T_world_camera: Array) -> list[TumEntry]:
    """Return the line of a TUM list for a pose, none where it is no rigid motion."""
    if not np.isfinite(T_world_camera).all():
        return []
    U, _, V = np.linalg.svd(T_world_camera[:3, :3])
    try:
        rotation = quaternion_from_rotation(U @ V)
    except InputError:
        return []
    return [TumEntry(stamp, tuple(map(str, (*T_world_camera[:3, 3].tolist(), *rotation.tolist()))))]


def pose_of_each_line(file: Path, images: Sequence[TumEntry]) -> list[TumEntry]:
    """Return the poses of a file with the 16 numbers of one a line.

    As many as there are images are theirs, in order; else line after line is that of the frames from 0 on. Lines that
    are no pose are left out, counted and told; each stands for its frame all the same. Blank lines and
    comments stand for none. A file that cannot be read is told and done without.
    """
    try:
        lines = [(n, line.split()) for n, line in enumerate(file.read_text(encoding="utf-8-sig").splitlines(), start=1)]
    except (OSError, UnicodeDecodeError) as error:
        log.warning("%s cannot be read: %s; it goes on without truth", file, error)
        return []
    lines = [(number, words) for number, words in lines if words and not words[0].startswith("#")]
    one_each = len(lines) == len(images)
    stamps = [image.stamp for image in images] if one_each else [stamp_of_frame(k) for k in range(len(lines))]
    poses = [_pose_of_words(stamp, words) for stamp, (_, words) in zip(stamps, lines, strict=True)]
    if wrong := [number for (number, _), pose in zip(lines, poses, strict=True) if not pose]:
        log.warning(
            "%s: %d of its %d poses are left out, as line %d: give the 16 numbers of a matrix T_world_camera a line",
            file, len(wrong), len(lines), wrong[0],
        )  # fmt: skip
    return [entry for pose in poses for entry in pose]


def _pose_of_words(stamp: Stamp, words: Sequence[str]) -> list[TumEntry]:
    try:
        return true_pose(stamp, np.array(words, dtype=float).reshape(4, 4))
    except ValueError:
        return []


def poses_of_images(path: Path, images: Sequence[TumEntry]) -> list[TumEntry]:
    """Return the poses of `*traj*.log` (Open3D's) or the last of `extrinsics/*.txt` (SUN3D's), one an image in order.

    A file with another number of poses than there are images is told and left aside: whose they are is not known.
    Without such files they are those of `groundtruth.txt`, by its stamps.
    """
    files = [*sorted(visible(path, "*traj*.log")), *sorted(visible(path / "extrinsics", "*.txt"), reverse=True)]
    if not files:
        return _by_their_stamps(path / "groundtruth.txt", images)
    size = _HEAD + _MATRIX if files[0].suffix == ".log" else _ROWS
    try:
        numbers = np.array(files[0].read_text().split(), dtype=float)
        rows = numbers.reshape(len(images), size)[:, -_MATRIX:]
    except (OSError, ValueError) as error:
        log.warning(
            "%s is left aside, it does not hold a pose for each of the %d colour images: %s; it goes on without truth",
            files[0], len(images), error,
        )  # fmt: skip
        return []
    T_world_camera = np.tile(np.eye(4), (len(images), 1, 1))
    T_world_camera[:, : rows.shape[1] // 4] = rows.reshape(len(images), -1, 4)
    return [pose for image, T in zip(images, T_world_camera, strict=True) for pose in true_pose(image.stamp, T)]


def trajectory_in(file: Path) -> list[TumEntry]:
    """Return the poses of a trajectory in TUM's format, none where it is not there; one that is damaged is told."""
    try:
        return read_list(file, 7) if file.is_file() else []
    except SourceError as error:
        log.warning("%s; it goes on without truth", error)
        return []


def _by_their_stamps(file: Path, images: Sequence[TumEntry]) -> list[TumEntry]:
    """Return the poses of a trajectory whose stamps are of the images' kind: times, or both numbers of frames."""
    poses = trajectory_in(file)
    if not poses or not all(is_of_frame(image.stamp) for image in images):
        return poses
    if counts_frames(poses):
        return as_frames(poses)
    log.warning(
        "%s is left aside, it has stamps in seconds and the images have numbers alone: list the images with their "
        "stamps in rgb.txt and depth.txt; it goes on without truth",
        file,
    )
    return []
