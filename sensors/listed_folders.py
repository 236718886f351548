"""Folders whose lists say which image or pose has which stamp: TUM's, ETH3D's and ICL-NUIM's."""

import logging
from pathlib import Path

from odom.errors import ConfigError, SourceError
from odom.frame import Camera, from_seconds
from sensors.default_camera import ICL_NUIM, image_size
from sensors.image_lists import SECOND, FolderLayout, TumEntry, read_list, stamp_of_frame

log = logging.getLogger(__name__)

ASSOCIATIONS = ("associations.txt", "associate.txt", "association.txt")
"""Names of lists of pairs of images."""


def tum(path: Path) -> FolderLayout:
    """TUM's, and ETH3D's, which adds a `calibration.txt`; a trajectory that cannot be read is done without."""
    color, depth, truth = read_list(path / "rgb.txt", 1), read_list(path / "depth.txt", 1), []
    file = path / "groundtruth.txt"
    if file.is_file():
        try:
            truth = read_list(file, 7)
        except SourceError as error:
            log.warning("%s; it goes on without truth", error)
    return FolderLayout("rgb.txt or depth.txt", color, depth, truth, _intrinsics_in_a_row(path, color))


def associated(path: Path) -> FolderLayout:
    """ICL-NUIM's: one list with stamp and file of both images a line, and the trajectory in `*.gt.freiburg`.

    That trajectory is of a camera and a world whose y axis points up: fy is -480 there.
    """
    file = next(path / name for name in ASSOCIATIONS if (path / name).is_file())
    pairs = read_list(file, 3)
    first = [TumEntry(entry.stamp, entry.values[:1]) for entry in pairs]
    second = sorted((_second(file, entry) for entry in pairs), key=lambda entry: entry.stamp)
    drawn = next(iter(sorted(path.glob("*.gt.freiburg"))), None)
    measured = path / "groundtruth.txt"
    truth = read_list(measured, 7) if drawn is None and measured.is_file() else []
    if drawn is not None:
        truth = [_mirrored(entry) for entry in read_list(drawn, 7)]
    if all(entry.stamp % SECOND == 0 for entry in (*first, *second)):  # frames are counted
        first, second, truth = (
            [TumEntry(stamp_of_frame(entry.stamp // SECOND), entry.values) for entry in entries]
            for entries in (first, second, truth)
        )
    color, depth = (second, first) if pairs and "depth" in pairs[0].values[0] else (first, second)
    size = image_size(path / color[0].values[0]) if drawn is not None and color else None
    camera = ICL_NUIM if size == (ICL_NUIM.width, ICL_NUIM.height) else None
    return FolderLayout(file.name, color, depth, truth, camera)


def _second(file: Path, pair: TumEntry) -> TumEntry:
    """Return the second image of a pair with the stamp of its own."""
    try:
        return TumEntry(from_seconds(pair.values[1]), pair.values[2:])
    except ValueError as error:
        raise SourceError(f"{file}: {pair.values[1]!r} is not a time stamp in seconds") from error


def _mirrored(entry: TumEntry) -> TumEntry:
    """Return a pose with the y axes of camera and world turned round."""
    x, y, z, qx, qy, qz, qw = entry.values
    return TumEntry(entry.stamp, (x, _negative(y), z, _negative(qx), qy, _negative(qz), qw))


def _negative(number: str) -> str:
    return number[1:] if number.startswith("-") else f"-{number}"


def _intrinsics_in_a_row(path: Path, images: list[TumEntry]) -> Camera | None:
    """Return the camera of `calibration.txt`, which holds fx fy cx cy, with the size of the first image."""
    file = path / "calibration.txt"
    size = image_size(path / images[0].values[0]) if file.is_file() and images else None
    if size is None:
        return None
    try:
        fx, fy, cx, cy = map(float, file.read_text().split())
        return Camera(*size, fx, fy, cx, cy)
    except (OSError, ValueError, ConfigError) as error:
        log.warning("%s is left aside, it is not fx fy cx cy: %s", file, error)
        return None
