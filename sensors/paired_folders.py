"""Colour and depth in two folders without lists: those of Open3D's recorders, Redwood and SUN3D, and one's own."""

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from odom.frame import Camera, Stamp, from_seconds
from sensors.default_camera import image_in, image_size
from sensors.image_lists import READ_SUFFIXES, FolderLayout, TumEntry, stamp_of, stamp_of_frame
from sensors.intrinsic_files import matrix_camera, open3d_camera

_COLOR, _DEPTH = ("color", "rgb", "image"), "depth"
"""Names of the folders."""
_NUMBER_AND_MICROSECONDS = re.compile(r"\d+-(\d+)\Z")
"""Names such as `0000012-000000367104.jpg`: the number of the frame and its microseconds."""
_SECONDS = re.compile(r"\d+\.\d+\Z")
"""Names such as `1305031102.175304.png`."""
_ROTATED_BITS = 3
"""SUN3D writes millimetres rotated to the left by this many bits, so the lowest bits are 0 except for far depths."""
_LOOKED_AT, _MOST_FAR = 5, 0.1
"""Depth images that are looked at for that, and the share of far depths that they may hold. One image may be empty, or
show one wall at 1.6 m; of depth that is not rotated seven in eight have such a bit set, half of it in steps of 4 mm."""


def is_pair_of_folders(path: Path) -> bool:
    """Whether a folder holds images of colour and of depth in folders of their own."""
    return _color_folder(path) is not None and _holds_images(path / _DEPTH)


def pair_of_folders(path: Path) -> FolderLayout:
    """Return the images by the stamps in their names, or by their numbers; depth is in millimetres and registered.

    The camera is Open3D's `*intrinsic*.json`, or `*intrinsic*.txt` with a matrix, if one is there. Raises ConfigError
    where such a file holds something else.
    """
    folder = _color_folder(path)
    assert folder is not None
    color, depth = by_stamp(path, images_in(folder)), by_stamp(path, images_in(path / _DEPTH))
    size = image_size(path / color[0].values[0]) if color else None
    return FolderLayout(
        f"{folder.name}/ or {_DEPTH}/",
        color,
        depth,
        [],
        None if size is None else _camera(path, size),
        depth_scale=1000.0,
        rotated_bits=_ROTATED_BITS if depth and _is_rotated(path, depth) else 0,
    )


def _color_folder(path: Path) -> Path | None:
    return next((path / name for name in _COLOR if _holds_images(path / name)), None)


def _holds_images(folder: Path) -> bool:
    return folder.is_dir() and next(images_in(folder), None) is not None


def images_in(folder: Path, pattern: str = "*") -> Iterator[Path]:
    """Yield the images of a folder whose names fit the pattern, whatever their suffix's spelling."""
    return (file for file in folder.glob(pattern) if file.suffix.lower() in READ_SUFFIXES)


def by_stamp(path: Path, files: Iterable[Path]) -> list[TumEntry]:
    """Return files below `path` by the stamps or numbers in their names; those whose names hold none are left out."""
    numbered = (file for file in files if re.search(r"\d", file.stem))
    entries = (TumEntry(_stamp(file.stem), (file.relative_to(path).as_posix(),)) for file in numbered)
    return sorted(entries, key=lambda entry: (entry.stamp, entry.values))


def _stamp(stem: str) -> Stamp:
    if found := _NUMBER_AND_MICROSECONDS.search(stem):
        return Stamp(int(found[1]) * 1_000)
    if found := _SECONDS.search(stem):
        return from_seconds(found[0])
    number = re.findall(r"\d+", stem)[-1]
    stamp, unit = stamp_of(number)
    return stamp_of_frame(int(number)) if unit == "seconds" else stamp


def _camera(path: Path, size: tuple[int, int]) -> Camera | None:
    if files := sorted(path.glob("*intrinsic*.json")):
        return open3d_camera(files[0])
    files = sorted(path.glob("*intrinsic*.txt"))
    return matrix_camera(files[0], size) if files else None


def _is_rotated(path: Path, depth: Sequence[TumEntry]) -> bool:
    """Return whether the lowest bits of depth are hardly ever set, in images from all over the recording."""
    odd = [share for k in range(0, len(depth), -(-len(depth) // _LOOKED_AT)) for share in _odd(path, depth[k])]
    return bool(odd) and float(np.mean(odd)) < _MOST_FAR


def _odd(path: Path, entry: TumEntry) -> list[float]:
    """Return the share of an image's depths that have any of the lowest bits set, nothing where it holds no depth."""
    depth = image_in(path / entry.values[0], cv2.IMREAD_UNCHANGED)
    if depth is None or depth.dtype != np.uint16:
        return []
    seen = depth[depth > 0]
    return [float(np.mean(seen & ((1 << _ROTATED_BITS) - 1) > 0))] if seen.size else []
