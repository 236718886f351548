"""Images of folders without lists: which files they are, and the stamps or numbers in their names."""

import logging
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from odom.frame import Stamp, stamp_of
from sensors.image_lists import IMAGE_SUFFIXES, READ_SUFFIXES, TumEntry, stamp_of_frame, unit_by_steps
from sensors.names_of_dates import stamps_of_dates
from sensors.split_stamps import are_seconds_and_parts, stamps_of_parts, tell_without_zeros, without_leading_zeros

log = logging.getLogger(__name__)

COLOR_WORDS, DEPTH_WORDS = ("color", "colour", "rgb", "image"), ("depth",)
"""What folders or images of colour and of depth are called, in small letters and without the s of several."""
_NUMBER_AND_MICROSECONDS = re.compile(r"\d+-(\d{12})\Z")
"""Names such as `0000012-000000367104.jpg`, SUN3D's: the number of the frame and its microseconds."""
_WITH_POINT = re.compile(r"\d+\.\d+\Z")
"""Names such as `1305031102.175304.png`: a stamp with a point."""
_NUMBER = re.compile(r"\d+")


def visible(folder: Path, pattern: str = "*") -> Iterator[Path]:
    """Yield the files of a folder whose names fit the pattern, without hidden ones: macOS puts `._NAME` beside NAME."""
    return (file for file in folder.glob(pattern) if not file.name.startswith("."))


def images_in(folder: Path, pattern: str = "*") -> Iterator[Path]:
    """Yield the images of a folder whose names fit the pattern, whatever their suffix's spelling."""
    return (file for file in visible(folder, pattern) if file.suffix.lower() in IMAGE_SUFFIXES)


def by_stamp(path: Path, files: Iterable[Path]) -> list[TumEntry]:
    """Return files below `path` by the stamps or numbers in their names; those whose names hold none are left out.

    Where some are images that are read, others (see `IMAGE_SUFFIXES`) are none of the stream's.
    Of several numbers that one counts which differs from file to file: not the size in `frame_0001_640x480`.
    """
    files = list(files)
    groups = alike([file for file in files if file.suffix.lower() in READ_SUFFIXES] or files).values()
    timed = [pair for group in groups for pair in zip(group, _stamps(path, [f.stem for f in group]), strict=True)]
    if timeless := sorted(file for file, stamp in timed if stamp is None):
        log.warning(
            "%s: left out, with %d more: the number in its name is neither that of a frame nor a time since 1970; "
            "rename the images, or list them with their stamps in rgb.txt and depth.txt",
            timeless[0], len(timeless) - 1,
        )  # fmt: skip
    entries = [TumEntry(stamp, (file.relative_to(path).as_posix(),)) for file, stamp in timed if stamp is not None]
    return sorted(entries, key=lambda entry: (entry.stamp, entry.values))


def alike(files: Iterable[Path], number: re.Pattern[str] = _NUMBER) -> dict[str, list[Path]]:
    """Return the files by their names without suffix, 0 for each `number` in them; those without one are left out."""
    groups = defaultdict[str, list[Path]](list)
    for file in files:
        name, numbers = number.subn("0", file.stem)
        if numbers:
            groups[name].append(file)
    return groups


def _stamps(path: Path, stems: list[str]) -> Sequence[Stamp | None]:
    """Return the stamps in names that differ in their digits only, None of a name that holds no time."""
    if all(_NUMBER_AND_MICROSECONDS.search(stem) for stem in stems):
        return [Stamp(int(stem[-12:]) * 1_000) for stem in stems]
    if (dates := stamps_of_dates(stems)) is not None:
        return dates
    columns = list(zip(*(_NUMBER.findall(stem) for stem in stems), strict=True))
    if points := [found[0] for stem in stems if (found := _WITH_POINT.search(stem))]:
        if (whole := without_leading_zeros(points)) is not None:
            tell_without_zeros(path)
        return _agreeing(whole or list(map(_stamp, points)), columns[:-2])
    if len(columns) > 1 and are_seconds_and_parts(*columns[-2:]):
        return stamps_of_parts(*columns[-2:])
    which = max(reversed(range(len(columns))), key=lambda k: len(set(columns[k])))
    if suggested := unit_by_steps(columns[which]):
        log.warning(
            "%s: the numbers in names such as %s step by %d: if these are %s, list the images with stamps in seconds "
            "in rgb.txt and depth.txt", path, min(stems), *suggested,
        )  # fmt: skip
    return _agreeing(list(map(_stamp, columns[which])), columns[:which])


def _agreeing(stamps: Sequence[Stamp | None], before: Sequence[tuple[str, ...]]) -> Sequence[Stamp | None]:
    """Return stamps in whose order the numbers `before` them in the names do not fall, else None for each name.

    They fall where what was taken for a time is but a part of it, which begins anew with each minute or scene.
    """
    names = sorted((stamp, *map(int, rest)) for stamp, *rest in zip(stamps, *before, strict=True) if stamp is not None)
    falls = any(later[1:] < name[1:] for name, later in pairwise(names))
    return [None] * len(stamps) if falls else stamps


def _stamp(number: str) -> Stamp | None:
    try:
        stamp, unit = stamp_of(number)
    except ValueError:
        return None
    return stamp_of_frame(int(number)) if unit == "seconds" and number.isdigit() else stamp
