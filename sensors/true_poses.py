"""True poses of folders of images, from files of matrices: one a pose, or one for all images in their order."""

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from odom.errors import InputError
from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.geometry.quaternion import quaternion_from_rotation
from sensors.image_lists import TumEntry
from sensors.image_names import visible

log = logging.getLogger(__name__)

THE_CAMERAS_OWN = np.eye(4)
"""`T_body_camera` of true poses that are the colour camera's."""
_HEAD, _MATRIX, _ROWS = 3, 16, 12
"""Numbers of a pose in Open3D's `trajectory.log`, those of frames before those of its matrix; and in SUN3D's, which
lacks the last row."""


def pose_in(folder: Path, entry: TumEntry, T_body_camera: Array = THE_CAMERAS_OWN) -> list[TumEntry]:
    """Return the camera's pose from a file with its body's pose, none where that was lost (infinities in ScanNet)."""
    try:
        T_world_body = np.loadtxt(folder / entry.values[0]).reshape(4, 4)
    except (OSError, ValueError):
        return []
    return true_pose(entry.stamp, T_world_body @ T_body_camera) if np.isfinite(T_world_body).all() else []


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


def poses_of_images(path: Path, images: Sequence[TumEntry]) -> list[TumEntry]:
    """Return the poses of `*traj*.log` (Open3D's) or the last of `extrinsics/*.txt` (SUN3D's), one an image in order.

    A file with another number of poses than there are images is told and left aside: whose they are is not known.
    """
    files = [*sorted(visible(path, "*traj*.log")), *sorted(visible(path / "extrinsics", "*.txt"), reverse=True)]
    if not files:
        return []
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
