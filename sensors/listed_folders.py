"""Folders whose lists say which image or pose has which stamp: TUM's, ETH3D's and ICL-NUIM's."""

import logging
from pathlib import Path, PurePath

from odom.errors import ConfigError, SourceError
from odom.frame import Camera, Stamp, stamp_of
from sensors.default_camera import ICL_NUIM, first_size
from sensors.image_lists import IMAGE_SUFFIXES, FolderLayout, TumEntry, as_frames, counts_frames, read_list
from sensors.image_names import by_stamp, images_in, visible
from sensors.intrinsic_files import camera_beside
from sensors.split_stamps import without_leading_zeros
from sensors.true_poses import trajectory_in

log = logging.getLogger(__name__)

_ASSOCIATIONS = ("associations.txt", "associate.txt", "association.txt", "associated.txt", "assoc.txt")
"""Names of lists of pairs of images."""


def tum(path: Path) -> FolderLayout:
    """TUM's, and ETH3D's, which adds a `calibration.txt`; a trajectory that cannot be read is done without.

    Without `depth.txt` depth is what lies in `depth/`, by the stamps or numbers in the names. The camera is that of a
    file that `camera_beside` finds, as for `associated`.
    """
    file = path / "depth.txt"
    named = [] if file.is_file() else by_stamp(path, images_in(path / "depth"))
    color, depth = read_list(path / "rgb.txt", 1), named or read_list(file, 1)
    truth, camera = _truth_and_camera(path, color)
    if counts_frames(color) if named else counts_frames(color, depth):
        log.warning(
            "%s: the stamps of rgb.txt and depth.txt are whole numbers: they are taken for numbers of frames, 30 a "
            "second; for another rate, write seconds there: the number divided by the rate",
            path,
        )
        color, depth = as_frames(color), named or as_frames(depth)
        truth = as_frames(truth) if counts_frames(truth) else truth
    return FolderLayout("rgb.txt or depth.txt", color, depth, truth, camera)


def is_associated(path: Path) -> bool:
    """Whether a folder has a list of pairs, and images or a folder that `depth` is part of the name of."""
    return any((path / name).is_file() for name in _ASSOCIATIONS) and any(
        "depth" in child.name.lower() and (child.is_dir() or child.suffix.lower() in IMAGE_SUFFIXES)
        for child in visible(path)
    )


def associated(path: Path) -> FolderLayout:
    """ICL-NUIM's: one list with stamp and file of both images a line, and the trajectory in `*.gt.freiburg`.

    That trajectory, here and beside TUM's lists, is of a camera and a world whose y axis points up: fy is -480 there.
    """
    file = next(path / name for name in _ASSOCIATIONS if (path / name).is_file())
    pairs = read_list(file, 3)
    first = [TumEntry(entry.stamp, entry.values[:1]) for entry in pairs]
    second = sorted(_second(file, pairs), key=lambda entry: entry.stamp)
    color, depth = (second, first) if pairs and _is_depth(pairs[0].values[0]) else (first, second)
    truth, camera = _truth_and_camera(path, color)
    if counts_frames(color, depth):
        color, depth = as_frames(color), as_frames(depth)
        truth = as_frames(truth) if counts_frames(truth) else truth
    return FolderLayout(file.name, color, depth, truth, camera)


def _is_depth(name: str) -> bool:
    """Return whether an image is of depth by its name and its folder's, whatever those above are called."""
    return any("depth" in part.lower() for part in PurePath(name).parts[-2:])


def _truth_and_camera(path: Path, color: list[TumEntry]) -> tuple[list[TumEntry], Camera | None]:
    """Return the true poses of a folder, and its camera where its files or its true poses, if ICL-NUIM's, say it."""
    size = first_size(path, color)
    camera = _camera(path, size)
    drawn = next(iter(sorted(visible(path, "*.gt.freiburg"))), None)
    if drawn is None:
        return trajectory_in(path / "groundtruth.txt"), camera
    published = ICL_NUIM if size == (ICL_NUIM.width, ICL_NUIM.height) else None
    return [_mirrored(entry) for entry in trajectory_in(drawn)], camera or published


def _second(file: Path, pairs: list[TumEntry]) -> list[TumEntry]:
    """Return the second images of pairs with the stamps of their own."""
    given = [pair.values[1] for pair in pairs]
    stamps = without_leading_zeros(given) or [_stamp(file, text) for text in given]
    return [TumEntry(stamp, pair.values[2:]) for stamp, pair in zip(stamps, pairs, strict=True)]


def _stamp(file: Path, text: str) -> Stamp:
    try:
        return stamp_of(text)[0]
    except ValueError as error:
        raise SourceError(f"{file}: {text!r} is not a time stamp in seconds") from error


def _mirrored(entry: TumEntry) -> TumEntry:
    """Return a pose with the y axes of camera and world turned round."""
    x, y, z, qx, qy, qz, qw = entry.values
    return TumEntry(entry.stamp, (x, _negative(y), z, _negative(qx), qy, _negative(qz), qw))


def _negative(number: str) -> str:
    return number[1:] if number.startswith("-") else f"-{number}"


def _camera(path: Path, size: tuple[int, int] | None) -> Camera | None:
    """Return the camera of images of this size by a file that `camera_beside` finds; one that is none is told."""
    try:
        return None if size is None else camera_beside(path, size)
    except ConfigError as error:
        log.warning("%s; it is left aside", error)
        return None
