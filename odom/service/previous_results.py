"""Results of an earlier run in the folder of a new one: set aside in a subfolder, for a service within bounds."""

import logging
import re
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from fnmatch import fnmatch
from pathlib import Path

from odom.service.calibration_offer import CALIBRATION_FILE

_LOG = logging.getLogger(__name__)
OTHER_PARTS = "trajectory-segment-[0-9]*.txt"
"""Files of parts of a trajectory that were never joined to `trajectory.txt`."""
_RESULTS = (
    "odometry.txt",
    "trajectory.txt",
    OTHER_PARTS,
    "relative_step.txt",
    "relative_second.txt",
    "chain.txt",
    "chain_closed.txt",
    "relative_chain.txt",
    "truth.txt",
    "report.json",
    "plot.png",
    CALIBRATION_FILE,
)
_SHOWN = "session.rrd"
_TRUTHS = "truth_*.txt"
TRUTH_MARK = "# body "
"""How a file of truth begins, before the body's name."""
_SET_ASIDE = re.compile(r"until-\d{8}T\d{6}Z(-\d+)?\Z")
MOST_BYTES, _MOST_FOLDERS = 8 << 30, 500
"""Results of earlier starts that are kept: 8 GiB are two days at 30 Hz with motion capture at 240 Hz. More may
fill the disk, fewer lose what led up to a crash."""


def is_result(name: str) -> bool:
    """Return whether a run or its viewer may write a file of this name in the folder of its results."""
    return any(fnmatch(name, pattern) for pattern in (*_RESULTS, _SHOWN, _TRUTHS))


def set_aside(folder: Path, shown: bool = False) -> Path | None:
    """Move the results in `folder` into a subfolder named for the time of their end, and return that.

    Nothing is deleted but files that are empty when all of them are; None is returned then. With `shown` what a viewer
    has written goes too: ask for it before the next viewer begins to write.
    """
    results = [*_results(folder), *([folder / _SHOWN] if shown and (folder / _SHOWN).is_file() else [])]
    if not any(path.stat().st_size for path in results):
        _remove(results)
        return None
    written = max(path.stat().st_mtime for path in results)
    place = _free_place(folder / datetime.fromtimestamp(written, UTC).strftime("until-%Y%m%dT%H%M%SZ"))
    place.mkdir()
    for path in results:
        path.rename(place / path.name)
    return place


def drop_oldest(folder: Path) -> None:
    """Drop the oldest of what was set aside beyond 500 starts or 8 GiB, and log it."""
    places = [path for path in folder.iterdir() if _SET_ASIDE.match(path.name) and any(_results(path))]
    places.sort(key=lambda path: (path.stat().st_mtime_ns, path.name), reverse=True)
    size = 0
    for number, place in enumerate(places):
        size += sum(path.stat().st_size for path in _results(place))
        if number and (size > MOST_BYTES or number >= _MOST_FOLDERS):
            _LOG.warning("%s is dropped: older results than 8 GiB or %d starts hold", place, _MOST_FOLDERS)
            _remove(_results(place))
            if not any(place.iterdir()):
                place.rmdir()


def _remove(results: Iterable[Path]) -> None:
    for path in list(results):
        path.unlink()


def _results(folder: Path) -> Iterator[Path]:
    yield from (path for pattern in _RESULTS for path in sorted(folder.glob(pattern)) if path.is_file())
    yield from (path for path in sorted(folder.glob(_TRUTHS)) if _is_truth(path))


def _is_truth(path: Path) -> bool:
    with path.open("rb") as file:
        return file.readline(100).startswith(TRUTH_MARK.encode())


def _free_place(wanted: Path) -> Path:
    place, number = wanted, 1
    while place.exists():
        number += 1
        place = wanted.with_name(f"{wanted.name}-{number}")
    return place
