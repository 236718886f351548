"""Colour and depth in two folders without lists: those of Open3D's recorders, Redwood and SUN3D, and one's own."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sensors.default_camera import first_size
from sensors.image_lists import FolderLayout, TumEntry
from sensors.image_names import COLOR_WORDS, DEPTH_WORDS, by_stamp, images_in, visible
from sensors.image_reading import image_in
from sensors.intrinsic_files import camera_beside
from sensors.kinds_of_names import of_one_camera
from sensors.true_poses import poses_of_images

_ROTATED_BITS = 3
"""SUN3D writes millimetres rotated to the left by this many bits, so the lowest bits are 0 except for far depths."""
_LOOKED_AT, _MOST_FAR = 5, 0.1
"""Depth images that are looked at for that, and the share of far depths that they may hold. One image may be empty, or
show one wall at 1.6 m; of depth that is not rotated seven in eight have such a bit set, half of it in steps of 4 mm."""


def is_pair_of_folders(path: Path) -> bool:
    """Whether a folder holds images of colour and of depth in folders of their own."""
    return _folder(path, COLOR_WORDS) is not None and _folder(path, DEPTH_WORDS) is not None


def pair_of_folders(path: Path) -> FolderLayout:
    """Return the images by the stamps in their names, or by their numbers; depth is in millimetres and registered.

    The camera is that of a file that `camera_beside` finds; raises ConfigError where it holds something else.
    """
    color_folder, depth_folder = _folder(path, COLOR_WORDS), _folder(path, DEPTH_WORDS)
    assert color_folder is not None
    assert depth_folder is not None
    images = of_one_camera([*images_in(color_folder)], [*images_in(depth_folder)])
    color, depth = (by_stamp(path, files) for files in images)
    size = first_size(path, color)
    return FolderLayout(
        f"{color_folder.name}/ or {depth_folder.name}/",
        color,
        depth,
        poses_of_images(path, color),
        None if size is None else camera_beside(path, size),
        depth_scale=1000.0,
        rotated_bits=_ROTATED_BITS if depth and _is_rotated(path, depth) else 0,
    )


def _folder(path: Path, names: Sequence[str]) -> Path | None:
    """Return the folder with one of these names, in any letters and of one or several, that holds images."""
    called = {child.name.lower().removesuffix("s"): child for child in sorted(visible(path), reverse=True)}
    folders = (called[name] for name in names if name in called)
    return next((folder for folder in folders if folder.is_dir() and any(images_in(folder))), None)


def _is_rotated(path: Path, depth: Sequence[TumEntry]) -> bool:
    """Return whether the lowest bits of depth are hardly ever set, in images from all over the recording."""
    odd = [share for k in range(0, len(depth), -(-len(depth) // _LOOKED_AT)) for share in _odd(path, depth[k])]
    return bool(odd) and float(np.mean(odd)) < _MOST_FAR


def _odd(path: Path, entry: TumEntry) -> list[float]:
    """Return the share of an image's depths that have any of the lowest bits set, nothing where it holds no depth."""
    depth = image_in(path / entry.values[0])
    if depth is None or depth.dtype != np.uint16:
        return []
    seen = depth[depth > 0]
    return [float(np.mean(seen & ((1 << _ROTATED_BITS) - 1) > 0))] if seen.size else []
