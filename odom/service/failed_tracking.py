"""Why a run has failed or gone badly: the main reason and the remedy, in one line."""

import logging
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from odom.backend.estimate import IMAGE_AGAIN, NO_DEPTH, NO_PLACE, TOO_LITTLE
from odom.errors import OdomError
from odom.service.mask_file import read_mask
from odom.service.unlogged import unlogged
from odom.wire import Topics
from sensors.source import Source, refused_images

if TYPE_CHECKING:
    from odom.evaluation.diagnosis import Finding, Recording

_LOG = logging.getLogger(__name__)
_LOOKED_AT_S = 3.0
"""Seconds of the source that are looked at: fewer may miss a fault that is not in each frame, more only cost time."""
_UNIT_S = 0.5
"""Seconds of it by which the unit of depth is judged, which is the same in each image: a tenth of a second of work."""

_OF_THE_CAMERA = ("calibration size", "focal length", "depth scale")
"""Findings about the calibration: a wrong unit of depth or focal length makes others BAD, too."""
_LEAST_TRACKED = 0.5
"""Share of frames tracked below which a result is poor."""
_FAR_OFF_SHARE, _FAR_OFF_M = 0.3, 0.02
"""ATE of a poor result, as a share of the RMS distance of truth from its middle, and at least: a tracked Kinect is
within a twentieth, and truth itself is not better than millimetres."""
_REMEDIES = {
    NO_DEPTH: "stay 0.6 .. 4 m from surfaces, out of sunlight, and look whether depth images come all the time",
    TOO_LITTLE: "turn the light on, keep objects with corners in view, not a plain wall, and do not cover the camera",
    NO_PLACE: "the camera was lost, by a fast turn or something in front of it, and saw no place again that it had "
    "seen before: move slower, and go back to such a place",
    IMAGE_AGAIN: "the driver repeats its images: start it again, and look for a busy USB port or CPU",
}
"""What to do about each reason for which a frame is LOST."""
_OTHER_REMEDY = "see to that first, and run it again"


def why_not_tracked(
    report: dict[str, Any],
    source: str,
    open_again: Callable[[], Source] | None,
    mask: Path | None = None,
    start: float = 0.0,
) -> str:
    """Return what is wrong with a source of which nothing was tracked, and what to do.

    A source that can be opened again is examined as by `odom doctor`; for others the odometry's `report` gives the
    reason for which most frames were lost. The file `mask` says what is known to be the camera's carrier, `start` how
    many seconds were skipped.
    """
    if start and not report.get("colour", {}).get("given"):
        return f"--start {start:g} is behind the end of {source}: give less"
    if open_again is not None:
        try:
            if found := _main_fault(_quietly(open_again), mask):
                return found
        except (OdomError, OSError) as error:
            _LOG.debug("%s cannot be looked at: %s", source, error)
    reasons = Counter(report.get("lost_for", {})) or Counter(report.get("colour", {}).get("refused", {}))
    main = "".join(f"{count} frames: {reason}; " for reason, count in reasons.most_common(1))
    return f"{main}`odom doctor {source}` looks for the cause"


def why_poor(
    report: dict[str, Any], out: Path, open_again: Callable[[], Source], mask: Path | None = None
) -> str | None:
    """Return what is wrong with a recorded source whose result in the folder `out` is poor, and what to do.

    None when the result is good, or far off truth though `odom doctor` would find no fault; where less than half was
    tracked and it finds none, the counts of the `report` say what happened. A source of which nothing says what camera
    it is of is looked at in any case, but then only for faults of the calibration; and one without truth, which would
    show a wrong unit of depth, for that unit. The file `mask` says what is known to be the camera's carrier.
    """
    is_hardly_tracked = (report.get("completeness") or 0.0) < _LEAST_TRACKED
    fault = None
    try:
        opened = _quietly(open_again)
        is_poor = is_hardly_tracked or _is_far_off(report, out)
        if is_poor or getattr(opened, "is_assumed", False):
            fault = _main_fault(opened, mask, only_camera=not is_poor)
        elif report.get("ate_m") is None:
            fault = _wrong_unit(opened)
    except (OdomError, OSError) as error:
        _LOG.debug("the source cannot be looked at: %s", error)
    return fault or (_by_the_counts(report) if is_hardly_tracked else None)


def _by_the_counts(report: dict[str, Any]) -> str | None:
    """Return why most images gave no pose by the counts of the report, and what to do; None where nothing was lost."""
    color = report.get("colour", {})
    reasons = Counter({why: n for why, n in report.get("lost_for", {}).items() if n})
    reasons.update(color.get("refused", {}))
    if not reasons:
        return None
    listed = ", ".join(f"{count} {why}" for why, count in reasons.most_common())
    main = reasons.most_common(1)[0][0]
    given = color.get("given", report.get("frames"))
    tracked = f"only {report.get('tracked', 0)} of {given} colour images were tracked; the others: {listed}"
    return f"{tracked}. Most often, {main}: {_REMEDIES.get(main, _OTHER_REMEDY)}"


def _is_far_off(report: dict[str, Any], out: Path) -> bool:
    """Return whether the errors against truth are a good part of the way itself."""
    from odom.evaluation.files import read_tum

    if report.get("ate_m") is None:
        return False
    positions = read_tum(out / "truth.txt").positions
    extent_m = float(np.sqrt(np.square(positions - positions.mean(axis=0)).sum(axis=1).mean()))
    return bool(report["ate_m"] > max(_FAR_OFF_SHARE * extent_m, _FAR_OFF_M))


def _quietly(open_again: Callable[[], Source]) -> Source:
    """Open the source without log lines: the run has logged them already."""
    with unlogged():
        return open_again()


def _wrong_unit(opened: Source) -> str | None:
    """Return what is wrong with the unit of depth by the first images, None where nothing is, or nothing tells."""
    from odom.evaluation.diagnosis import Verdict
    from odom.evaluation.diagnosis.depth_unit import judge_unit

    frames = _sample(opened, _UNIT_S).paired
    finding = judge_unit(frames) if frames else None
    return _in_words(finding) if finding is not None and finding.verdict is Verdict.BAD else None


def _main_fault(opened: Source, mask: Path | None, only_camera: bool = False) -> str | None:
    """Return the first fault of the calibration, since others follow from it, else the first one if asked for."""
    from odom.evaluation.diagnosis import Verdict, examine

    recording = _sample(opened, _LOOKED_AT_S)
    refused = {**recording.refused, **refused_images(opened)}
    recording = replace(recording, refused=refused, mask=None if mask is None else read_mask(mask))
    bad = [finding for finding in examine(recording) if finding.verdict is Verdict.BAD]
    faults = [f for f in bad if f.key in _OF_THE_CAMERA] + ([] if only_camera else bad)
    return _in_words(faults[0]) if faults else None


def _in_words(finding: "Finding") -> str:
    return f"{finding.key}: {finding.value}: {finding.advice}"


def _sample(opened: Source, seconds: float) -> "Recording":
    """Return the first seconds of a source, and close it."""
    from odom.service.source_sample import collect

    with unlogged(), closing(opened):  # the run has logged already what the source leaves out
        return collect(opened.messages(), Topics(), seconds, lambda done: None, is_recorded=True)
