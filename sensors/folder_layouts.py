"""Folders of images as data sets lay them out: which files are colour, depth and true poses, and whose camera it is.

Where files carry numbers instead of stamps, they count frames of 1/30 s.
"""

import json
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from odom.errors import ConfigError, InputError, SourceError
from odom.frame import Camera, Stamp
from odom.geometry.arrays import Array
from odom.geometry.quaternion import quaternion_from_rotation
from sensors.default_camera import image_size
from sensors.image_lists import TumEntry, read_list

_RATE_HZ = 30
"""Frames a second assumed where a folder has no stamps: a Kinect's. It scales velocities, not the trajectory."""
_LISTS = ("associations.txt", "associate.txt", "association.txt")
_SEVEN_SCENES = Camera(640, 480, 585.0, 585.0, 320.0, 240.0)
"""The camera that 7-Scenes publishes for its images; 65535 stands for unknown depth there."""
_REPLICA = Camera(1200, 680, 600.0, 600.0, 599.5, 339.5)
"""The camera of Replica's rooms as they were drawn for NICE-SLAM, with 6553.5 units of depth a metre."""


@dataclass(frozen=True)
class FolderLayout:
    """The lists of a folder: `name` says where they are from; files are relative to the folder.

    `truth` holds poses as TUM writes them (x y z, quaternion x y z w). `camera` is None where nothing says it. Depth
    images have `depth_scale` units in a metre and `unknown_depth` where nothing was measured; they are those of
    `depth_camera`, if that is not colour's.
    """

    name: str
    color: list[TumEntry]
    depth: list[TumEntry]
    truth: list[TumEntry]
    camera: Camera | None = None
    depth_scale: float = 5000.0
    unknown_depth: int = 0
    depth_camera: Camera | None = None


def is_image_folder(path: Path) -> bool:
    """Whether a folder holds images in a layout that is known."""
    return (path / "rgb.txt").is_file() or any(_is(path) for _is, _ in _LAYOUTS)


def layout_of(path: Path) -> FolderLayout:
    """Return the lists of a folder of any layout but TUM's; raises SourceError when it has none that is known."""
    for _is, read in _LAYOUTS:
        if _is(path):
            return read(path)
    raise SourceError(f"{path} holds no images in a layout that is known")


def _seven_scenes(path: Path) -> FolderLayout:
    poses = _numbered(path, path.glob("frame-*.pose.txt"))
    return FolderLayout(
        "7-Scenes' frame-*.png",
        _numbered(path, path.glob("frame-*.color.png")),
        _numbered(path, path.glob("frame-*.depth.png")),
        [pose for entry in poses for pose in _pose(path, entry)],
        _SEVEN_SCENES,
        depth_scale=1000.0,
        unknown_depth=65535,
    )


def _scannet(path: Path) -> FolderLayout:
    color = _numbered(path, (file for file in (path / "color").iterdir() if file.suffix in (".jpg", ".png")))
    depth = _numbered(path, (path / "depth").glob("*.png"))
    poses = _numbered(path, (path / "pose").glob("*.txt"))
    camera = _intrinsics(path, "color", color)
    return FolderLayout(
        "color/ or depth/",
        color,
        depth,
        [pose for entry in poses for pose in _pose(path, entry)],
        camera,
        depth_scale=1000.0,
        depth_camera=None if camera is None else _intrinsics(path, "depth", depth),
    )


def _replica(path: Path) -> FolderLayout:
    images = path / "results"
    file = path / "traj.txt"
    lines = _lines(file) if file.is_file() else []
    poses = [_true(_stamp(i), np.array(line, dtype=float).reshape(4, 4)) for i, line in enumerate(lines)]
    camera, scale = _replica_camera(path)
    return FolderLayout(
        "results/",
        _numbered(path, (file for file in images.glob("frame*") if file.suffix in (".jpg", ".png"))),
        _numbered(path, images.glob("depth*.png")),
        [pose for found in poses for pose in found],
        camera,
        scale,
    )


def _associated(path: Path) -> FolderLayout:
    """ICL-NUIM's: one list with stamp and file of both images a line, and the trajectory in `*.gt.freiburg`."""
    file = next(path / name for name in _LISTS if (path / name).is_file())
    pairs = read_list(file, 3)
    is_depth_first = bool(pairs) and "depth" in pairs[0].values[0]
    first = [TumEntry(entry.stamp, entry.values[:1]) for entry in pairs]
    second = [TumEntry(entry.stamp, entry.values[2:]) for entry in pairs]
    truth_file = next(iter(sorted((*path.glob("*.gt.freiburg"), *path.glob("groundtruth.txt")))), None)
    truth = [] if truth_file is None else read_list(truth_file, 7)
    counts_frames = all(entry.stamp % 1_000_000_000 == 0 for entry in pairs)
    first, second, truth = (
        [TumEntry(_stamp(e.stamp // 1_000_000_000), e.values) if counts_frames else e for e in entries]
        for entries in (first, second, truth)
    )
    color, depth = (second, first) if is_depth_first else (first, second)
    return FolderLayout(file.name, color, depth, truth)


_LAYOUTS: tuple[tuple[Callable[[Path], bool], Callable[[Path], FolderLayout]], ...] = (
    (lambda path: any((path / name).is_file() for name in _LISTS) and (path / "depth").is_dir(), _associated),
    (lambda path: next(path.glob("frame-*.color.png"), None) is not None, _seven_scenes),
    (lambda path: all((path / name).is_dir() for name in ("color", "depth", "pose")), _scannet),
    (lambda path: next((path / "results").glob("depth*.png"), None) is not None, _replica),
)


def _numbered(folder: Path, files: Iterable[Path]) -> list[TumEntry]:
    """Return files by the last number in their names, with the stamp of that frame."""
    entries = []
    for file in files:
        numbers = re.findall(r"\d+", file.name.partition(".")[0])
        if numbers:
            entries.append(TumEntry(_stamp(int(numbers[-1])), (file.relative_to(folder).as_posix(),)))
    return sorted(entries, key=lambda entry: entry.stamp)


def _stamp(frame: int) -> Stamp:
    return Stamp(round(frame * 1_000_000_000 / _RATE_HZ))


def _pose(folder: Path, entry: TumEntry) -> list[TumEntry]:
    """Return the pose of a file of 16 numbers, none where tracking was lost (ScanNet writes infinities)."""
    try:
        T = np.loadtxt(folder / entry.values[0]).reshape(4, 4)
    except (OSError, ValueError):
        return []
    return _true(entry.stamp, T)


def _true(stamp: Stamp, T_world_camera: Array) -> list[TumEntry]:
    if not np.isfinite(T_world_camera).all():
        return []
    U, _, V = np.linalg.svd(T_world_camera[:3, :3])
    try:
        rotation = quaternion_from_rotation(U @ V)
    except InputError:
        return []
    return [TumEntry(stamp, tuple(map(str, (*T_world_camera[:3, 3].tolist(), *rotation.tolist()))))]


def _lines(file: Path) -> list[list[str]]:
    try:
        return [line.split() for line in file.read_text().splitlines() if len(line.split()) == 16]
    except (OSError, UnicodeDecodeError) as error:
        raise SourceError(f"{file} cannot be read: {error}") from error


def _intrinsics(path: Path, which: str, images: list[TumEntry]) -> Camera | None:
    """Return the camera of `intrinsic/intrinsic_color.txt` or a file like it, with the size of the first image."""
    files = [*path.glob(f"intrinsic*/intrinsic*_{which}.txt"), *path.glob(f"intrinsic*_{which}.txt")]
    size = image_size(path / images[0].values[0]) if images else None
    if not files or size is None:
        return None
    try:
        K = np.loadtxt(files[0])
        return Camera(*size, float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2]))
    except (OSError, ValueError, IndexError) as error:
        raise ConfigError(f"{files[0]}: give a matrix of 3 x 3 or 4 x 4 numbers: {error}") from error


def _replica_camera(path: Path) -> tuple[Camera, float]:
    file = next((f for f in (path / "cam_params.json", path.parent / "cam_params.json") if f.is_file()), None)
    if file is None:
        return _REPLICA, 6553.5
    try:
        c = json.loads(file.read_text())["camera"]
        fx, fy, cx, cy = (float(c[name]) for name in ("fx", "fy", "cx", "cy"))
        return Camera(int(c["w"]), int(c["h"]), fx, fy, cx, cy), float(c["scale"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{file}: give camera with w, h, fx, fy, cx, cy and scale: {error!r}") from error
