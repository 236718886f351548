"""Results of an earlier run in the folder of a new one: removed, or set aside in a subfolder, within bounds."""

import logging
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

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
    "truth.txt",
    "report.json",
    "plot.png",
)
_SHOWN = "session.rrd"
TRUTH_MARK = "# body "
"""How a file of truth begins, before the body's name."""
_SET_ASIDE = re.compile(r"until-\d{8}T\d{6}Z(-\d+)?\Z")
MOST_BYTES, _MOST_FOLDERS = 8 << 30, 500
"""Results of earlier starts that are kept: 8 GiB are two days at 30 Hz with motion capture at 240 Hz. More may
fill the disk, fewer lose what led up to a crash."""


def remove(folder: Path) -> None:
    """Remove the results in `folder`, and nothing else."""
    for path in list(_results(folder)):
        path.unlink()


def remove_shown(folder: Path) -> None:
    """Remove what an earlier run's viewer has written, before that of the next one begins to."""
    (folder / _SHOWN).unlink(missing_ok=True)


def set_aside(folder: Path) -> None:
    """Move the results in `folder` into a subfolder named for the time of their end, unless all are empty.

    Of all such subfolders the newest 500 keep their results, 8 GiB at most; those that are dropped are logged.
    """
    results = list(_results(folder))
    if not any(path.stat().st_size for path in results):
        remove(folder)
        return
    written = max(path.stat().st_mtime for path in results)
    place = _free_place(folder / datetime.fromtimestamp(written, UTC).strftime("until-%Y%m%dT%H%M%SZ"))
    place.mkdir()
    for path in results:
        path.rename(place / path.name)
    _drop_oldest(folder)


def _results(folder: Path) -> Iterator[Path]:
    yield from (path for pattern in _RESULTS for path in sorted(folder.glob(pattern)) if path.is_file())
    yield from (path for path in sorted(folder.glob("truth_*.txt")) if _is_truth(path))


def _is_truth(path: Path) -> bool:
    with path.open("rb") as file:
        return file.readline(100).startswith(TRUTH_MARK.encode())


def _free_place(wanted: Path) -> Path:
    place, number = wanted, 1
    while place.exists():
        number += 1
        place = wanted.with_name(f"{wanted.name}-{number}")
    return place


def _drop_oldest(folder: Path) -> None:
    places = [path for path in folder.iterdir() if _SET_ASIDE.match(path.name) and any(_results(path))]
    places.sort(key=lambda path: (path.stat().st_mtime_ns, path.name), reverse=True)
    size = 0
    for number, place in enumerate(places):
        size += sum(path.stat().st_size for path in _results(place))
        if number and (size > MOST_BYTES or number >= _MOST_FOLDERS):
            _LOG.warning("%s is dropped: older results than 8 GiB or %d starts hold", place, _MOST_FOLDERS)
            remove(place)
            if not any(place.iterdir()):
                place.rmdir()
