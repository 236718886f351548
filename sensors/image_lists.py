"""Lists of images and poses by their stamps, as the TUM RGB-D benchmark writes them, and those that a folder has."""

import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median_low

import numpy as np

from odom.errors import SourceError
from odom.frame import Camera, Stamp, stamp_of
from odom.frame.stamp import is_number
from odom.geometry.arrays import Array
from odom.geometry.quaternion import rotation_from_quaternion
from odom.wire.pairing import follows
from sensors.split_stamps import SECOND, tell_without_zeros, without_leading_zeros

log = logging.getLogger(__name__)

READ_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".ppm", ".pgm", ".webp")
"""What names of images that can be read end with, in small letters."""
IMAGE_SUFFIXES = (*READ_SUFFIXES, ".exr", ".npy", ".npz")
"""What names of images end with, numpy's files of depth and those that cannot be read included."""
_COMMENT = re.compile(r"(?:^|\s)#")
_QUOTES = "\"'"
_MOST_FRAMES = 10_000_000
"""Whole numbers below this are numbers of frames (four days of them), above they are seconds since 1970."""
_RATE_HZ = 30
"""Frames a second assumed where a folder has no stamps: a Kinect's. It scales velocities, not the trajectory."""
_LATEST = 2**31 * SECOND
"""In January 2038: seconds of a ROS time have 32 bits."""
_FEW_STAMPS = 3
"""Fewer do not tell by how much they step."""
_STEPS_MS = 10, 200
"""Milliseconds from one image of a camera to the next, at the least and at the most."""
_PARTS = {"milliseconds": 1, "microseconds": 1_000, "nanoseconds": 1_000_000}
"""How many of a unit are in a millisecond."""


@dataclass(frozen=True)
class TumEntry:
    """One line of a TUM list: its stamp and the other columns."""

    stamp: Stamp
    values: tuple[str, ...]


@dataclass(frozen=True)
class FolderLayout:
    """The lists of a folder: `name` says where they are from; files are relative to the folder.

    `truth` holds poses as TUM writes them (x y z, quaternion x y z w). `camera` is None where nothing says it. Depth
    images have `depth_scale` units in a metre and `unknown_depth` where nothing was measured, their 16 bits rotated to
    the left by `rotated_bits`. They are those of `depth_camera`, if that is not colour's, which is turned as colour's
    is and at `depth_position_m` in its frame.
    """

    name: str
    color: list[TumEntry]
    depth: list[TumEntry]
    truth: list[TumEntry]
    camera: Camera | None = None
    depth_scale: float = 5000.0
    unknown_depth: int = 0
    rotated_bits: int = 0
    depth_camera: Camera | None = None
    depth_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


def read_list(path: Path, columns: int) -> list[TumEntry]:
    """Read a TUM list file, sorted by stamp; lines of equal stamps keep their order.

    A first line that begins with a word is the columns' names. `#` at the beginning of a line or behind a blank begins
    a comment. Names of images may hold blanks and quotes, backslashes between folders, and commas where blanks separate
    the columns. Stamps of 12 digits or more before the point are milli-, micro- or nanoseconds, and nanoseconds behind
    the point may lack their leading zeros (see `without_leading_zeros`), which is logged. Raises SourceError naming
    file and line for one with fewer columns behind the stamp, a stamp that is no number or one beyond 2038.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise SourceError(f"{path} cannot be read: {error}") from error
    header: SourceError | None = None
    entries, units, stamps = list[TumEntry](), set[str](), list[str]()
    for number, line in enumerate(lines, start=1):
        words = _names_joined(_columns(_COMMENT.split(line)[0]))
        if not words:
            continue
        try:
            stamp, unit = stamp_of(words[0])
        except ValueError as error:
            refused = SourceError(f"{path}:{number}: {words[0]!r} is not a time stamp in seconds")
            if header is None and not entries and not any(map(str.isdigit, words[0])):
                header = refused
                continue
            raise refused from error
        if stamp >= _LATEST:
            raise SourceError(
                f"{path}:{number}: {words[0]} seconds are beyond 2038, which no recording holds: write seconds, "
                f"divide nanoseconds by {SECOND}"
            )
        units.add(unit)
        stamps.append(words[0])
        if len(words) <= columns:
            raise SourceError(f"{path}:{number}: {len(words)} columns, expected a stamp and {columns} more")
        entries.append(TumEntry(stamp, tuple(words[1 : columns + 1])))
    if other := sorted(units - {"seconds"}):
        log.info("%s: its stamps are taken for %s, by their number of digits", path, " and ".join(other))
    if (whole := without_leading_zeros(stamps)) is not None:
        tell_without_zeros(path)
        entries = [TumEntry(stamp, entry.values) for stamp, entry in zip(whole, entries, strict=True)]
    if suggested := unit_by_steps(stamps):
        log.warning("%s: its stamps step by %d: if these are %s, write seconds there", path, *suggested)
    if header is not None and not entries:
        raise header
    return sorted(entries, key=lambda entry: entry.stamp)


def unit_by_steps(stamps: Sequence[str]) -> tuple[int, str] | None:
    """Return by how much whole numbers step, and the unit in which that is the period of a camera.

    None where there is no such unit, or where they are taken for times in it by their digits.
    """
    if len(stamps) < _FEW_STAMPS or not all(map(str.isdecimal, stamps)):
        return None
    step = median_low(later - number for number, later in pairwise(sorted(map(int, stamps))))
    unit = next((unit for unit, part in _PARTS.items() if _STEPS_MS[0] <= step / part <= _STEPS_MS[1]), None)
    return None if unit is None or unit == _taken_for(stamps[0]) else (step, unit)


def _taken_for(stamp: str) -> str | None:
    try:
        return stamp_of(stamp)[1]
    except ValueError:
        return None


def _columns(line: str) -> list[str]:
    """Return the words of a line between blanks or commas, but not between those in an image's name."""
    words = line.split()
    if "," not in line or "," in words[0]:
        return line.replace(",", " ").split()
    return [part for word in words for part in ([word] if _is_one_name(word) else word.replace(",", " ").split())]


def _is_one_name(word: str) -> bool:
    *before, last = (part.strip(_QUOTES).lower().endswith(IMAGE_SUFFIXES) for part in word.split(","))
    return last and not any(before)


def _names_joined(words: list[str]) -> list[str]:
    """Return the words of a line with those put together that are parts of one image's name."""
    if all(map(is_number, words)):  # a pose, as most lines are
        return words
    found: list[str] = []
    rest = words
    while rest:
        ends = (k for k, word in enumerate(rest, start=1) if word.strip(_QUOTES).lower().endswith(IMAGE_SUFFIXES))
        count = 1 if not found or is_number(rest[0]) else next(ends, 1)
        name, rest = " ".join(rest[:count]), rest[count:]
        found.append(name.strip(_QUOTES).replace("\\", "/"))
    return found


def steady(entries: Sequence[TumEntry]) -> TumEntry | None:
    """Return the first entry whose stamp another follows within a second, None without one."""
    return next((entry for entry, later in pairwise(entries) if follows(later.stamp, entry.stamp)), None)


def pose_of(entry: TumEntry) -> Array:
    """Return `T_world_camera` (4 x 4) of a line of a trajectory; raises ValueError for what is no pose."""
    values = np.array([float(value) for value in entry.values])
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = rotation_from_quaternion(values[3:])
    T_world_camera[:3, 3] = values[:3]
    return T_world_camera


def stamp_of_frame(frame: int) -> Stamp:
    """Return the stamp of a frame that has a number alone."""
    return Stamp(round(frame * SECOND / _RATE_HZ))


def is_of_frame(stamp: Stamp) -> bool:
    """Return whether a stamp is that of a frame that has a number alone, and no time since 1970."""
    return stamp * _RATE_HZ < _MOST_FRAMES * SECOND and stamp == stamp_of_frame(round(stamp * _RATE_HZ / SECOND))


def counts_frames(*lists: list[TumEntry]) -> bool:
    """Return whether the stamps are numbers of frames: whole, from the beginning, and not all the same."""
    stamps = [entry.stamp for entries in lists for entry in entries]
    return len(set(stamps)) > 1 and all(stamp % SECOND == 0 and stamp < _MOST_FRAMES * SECOND for stamp in stamps)


def as_frames(entries: list[TumEntry]) -> list[TumEntry]:
    """Return a list whose stamps, in seconds, are numbers of frames."""
    return [TumEntry(stamp_of_frame(entry.stamp // SECOND), entry.values) for entry in entries]
