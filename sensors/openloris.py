"""OpenLORIS' folders: TUM's lists under other names; poses of the robot's base become those of its camera."""

import logging
from pathlib import Path

import cv2
import numpy as np

from odom.errors import ConfigError, SourceError
from odom.frame import Camera
from odom.geometry.arrays import Array
from sensors.image_lists import FolderLayout, TumEntry, pose_of, read_list
from sensors.intrinsic_files import tell_other_size
from sensors.opencv_calibration import matrix_at, opencv_storage
from sensors.true_poses import true_pose

log = logging.getLogger(__name__)

_COLOR_FRAME, _BASE_FRAME = "d400_color_optical_frame", "base_link"
"""What the files call the colour camera to which depth is aligned, and the body whose poses are the truth."""
_LISTS = "color.txt", "aligned_depth.txt"


def is_openloris(path: Path) -> bool:
    """Whether a folder has OpenLORIS' lists of colour and aligned depth."""
    return all((path / name).is_file() for name in _LISTS)


def openloris(path: Path) -> FolderLayout:
    """Return the lists; depth is in millimetres, the camera from `sensors.yaml`.

    Truth is carried from the base to the camera by `trans_matrix.yaml`, and done without where that does not say how.
    """
    color, depth = (read_list(path / name, 1) for name in _LISTS)
    return FolderLayout(" or ".join(_LISTS), color, depth, _truth(path), _camera(path / "sensors.yaml"), 1000.0)


def _truth(path: Path) -> list[TumEntry]:
    file = path / "groundtruth.txt"
    if not file.is_file():
        return []
    try:
        T_base_camera = _T_base_camera(path / "trans_matrix.yaml")
        return [_of_camera(entry, T_base_camera) for entry in read_list(file, 7)]
    except (ConfigError, SourceError) as error:
        log.warning("%s; it goes on without truth", error)
        return []


def _of_camera(entry: TumEntry, T_base_camera: Array) -> TumEntry:
    """Return the camera's pose; what is none stays as it is, for the source to count."""
    try:
        return next(iter(true_pose(entry.stamp, pose_of(entry) @ T_base_camera)), entry)
    except ValueError:
        return entry


def _T_base_camera(file: Path) -> Array:
    """Return the camera's pose in the base's frame, along the frames between; raises ConfigError."""
    storage = _opened(file)  # its nodes live as long as it does
    mounts = storage.getNode("trans_matrix")
    above = {
        mount.getNode("child_frame").string(): (mount.getNode("parent_frame").string(), mount)
        for mount in (mounts.at(k) for k in range(mounts.size() if mounts.isSeq() else 0))
        if mount.isMap()
    }
    T_frame_camera, frame = np.eye(4), _COLOR_FRAME
    while frame != _BASE_FRAME:
        if frame not in above:
            raise ConfigError(f"{file} does not say where {_COLOR_FRAME} is in {_BASE_FRAME}, whose poses the truth is")
        frame, mount = above.pop(frame)
        matrix = matrix_at(mount, file, ("matrix",))
        if matrix is None or matrix.shape != (4, 4):
            raise ConfigError(f"{file}: the matrix in {frame} is not 4 x 4")
        T_frame_camera = matrix @ T_frame_camera
    return T_frame_camera


def _camera(file: Path) -> Camera | None:
    if not file.is_file():
        return None
    try:
        storage = _opened(file)  # its nodes live as long as it does
        sensor = storage.getNode(_COLOR_FRAME)
        intrinsics, lens = (
            matrix_at(sensor, file, (name,)) if sensor.isMap() else None
            for name in ("intrinsics", "distortion_coefficients")
        )
        if intrinsics is None or intrinsics.size != 4:
            raise ConfigError(f"{file}: give {_COLOR_FRAME} with width, height and intrinsics: fx, cx, fy, cy")
        fx, cx, fy, cy = map(float, intrinsics.ravel())
        size = int(sensor.getNode("width").real()), int(sensor.getNode("height").real())
        known = () if lens is None or not lens.any() else tuple(map(float, lens.ravel()))
        camera = Camera(*size, fx, fy, cx, cy, known)
    except ConfigError as error:
        log.warning("%s; its camera is left aside", error if str(file) in str(error) else f"{file}: {error}")
        return None
    tell_other_size(file, camera)
    return camera


def _opened(file: Path) -> cv2.FileStorage:
    try:
        return opencv_storage(file, file.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file} cannot be read: {error}") from error
