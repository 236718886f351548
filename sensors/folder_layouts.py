"""Folders of images in the layouts of data sets: which files are colour, depth and true poses, and which camera.

Where files carry numbers instead of stamps, they count frames of 1/30 s.
"""

import json
from collections.abc import Callable
from pathlib import Path

from odom.errors import ConfigError, SourceError
from odom.frame import Camera
from sensors.default_camera import first_size
from sensors.image_lists import FolderLayout, TumEntry
from sensors.image_names import by_stamp, images_in, visible
from sensors.intrinsic_files import matrix_camera
from sensors.kinds_of_names import of_one_camera
from sensors.listed_folders import associated, is_associated, tum
from sensors.mixed_folder import is_mixed_folder, mixed_folder
from sensors.openloris import is_openloris, openloris
from sensors.paired_folders import is_pair_of_folders, pair_of_folders
from sensors.true_poses import pose_of_each_line, poses_in, poses_of_images

_REPLICA = Camera(1200, 680, 600.0, 600.0, 599.5, 339.5)
"""The camera of Replica's rooms as they were drawn for NICE-SLAM, with 6553.5 units of depth a metre."""


def is_image_folder(path: Path) -> bool:
    """Whether a folder holds images in a layout that is known."""
    return any(_is(path) for _is, _ in _LAYOUTS)


def layout_of(path: Path) -> FolderLayout:
    """Return the lists of a folder.

    Raises SourceError when it has no layout that is known or a list is damaged, ConfigError when the camera that its
    files describe cannot be used.
    """
    for _is, read in _LAYOUTS:
        if _is(path):
            return read(path)
    raise SourceError(f"{path} holds no images in a layout that is known")


def _is_scannet(path: Path) -> bool:
    return all((path / name).is_dir() for name in ("color", "depth")) and any(
        (path / name).is_dir() for name in ("pose", "intrinsic")
    )


def _scannet(path: Path) -> FolderLayout:
    """Return the lists of folders whose files are named by numbers, or by stamps; true poses may be missing."""
    images = of_one_camera(*([*images_in(path / name)] for name in ("color", "depth")))
    color, depth = (by_stamp(path, files) for files in images)
    poses = by_stamp(path, visible(path / "pose", "*.txt"))
    camera = _intrinsics(path, "color", color)
    return FolderLayout(
        "color/ or depth/",
        color,
        depth,
        poses_in(path, poses) or poses_of_images(path, color),
        camera,
        depth_scale=1000.0,
        depth_camera=None if camera is None else _intrinsics(path, "depth", depth),
    )


def _replica(path: Path) -> FolderLayout:
    images = path / "results"
    file = path / "traj.txt"
    camera, scale = _replica_camera(path)
    color = by_stamp(path, images_in(images, "frame*"))
    return FolderLayout(
        "results/",
        color,
        by_stamp(path, images.glob("depth*.png")),
        pose_of_each_line(file, color) if file.is_file() else [],
        camera,
        scale,
    )


_LAYOUTS: tuple[tuple[Callable[[Path], bool], Callable[[Path], FolderLayout]], ...] = (
    (lambda path: all((path / name).is_file() for name in ("rgb.txt", "depth.txt")), tum),
    (is_associated, associated),
    (lambda path: (path / "rgb.txt").is_file(), tum),
    (is_openloris, openloris),
    (_is_scannet, _scannet),
    (lambda path: next((path / "results").glob("depth*.png"), None) is not None, _replica),
    (is_pair_of_folders, pair_of_folders),
    (is_mixed_folder, mixed_folder),
)


def _intrinsics(path: Path, which: str, images: list[TumEntry]) -> Camera | None:
    """Return the camera of `intrinsic/intrinsic_color.txt` or a file like it, with the size of the first image."""
    files = [*path.glob(f"intrinsic*/intrinsic*_{which}.txt"), *path.glob(f"intrinsic*_{which}.txt")]
    size = first_size(path, images)
    return None if not files or size is None else matrix_camera(files[0], size)


def _replica_camera(path: Path) -> tuple[Camera, float]:
    file = next((f for f in (path / "cam_params.json", path.parent / "cam_params.json") if f.is_file()), None)
    if file is None:
        return _REPLICA, 6553.5
    try:
        c = json.loads(file.read_text(encoding="utf-8-sig"))["camera"]
        fx, fy, cx, cy = (float(c[name]) for name in ("fx", "fy", "cx", "cy"))
        scale = float(c["scale"])
        if not 1 <= scale <= 1e6:
            raise ValueError(f"scale {scale:g} units a metre")
        return Camera(int(c["w"]), int(c["h"]), fx, fy, cx, cy), scale
    except (OSError, ValueError, KeyError, TypeError, ConfigError) as error:
        raise ConfigError(f"{file}: give camera with w, h, fx, fy, cx, cy and scale: {error!r}") from error
