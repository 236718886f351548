"""Why no frame of a run was tracked: the main reason and the remedy, in one line."""

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from odom.errors import OdomError
from odom.wire import Topics
from sensors.source import Source, refused_images

_LOG = logging.getLogger(__name__)
_LOOKED_AT_S = 3.0
"""Seconds of the source that are looked at: fewer may miss a fault that is not in each frame, more only cost time."""


def why_not_tracked(report: dict[str, Any], source: str, open_again: Callable[[], Source] | None) -> str:
    """Return what is wrong with a source of which nothing was tracked, and what to do.

    A source that can be opened again is looked at as `odom doctor` does; of another one the odometry's `report` says
    for which reason most frames were lost.
    """
    if open_again is not None:
        try:
            if found := _main_fault(open_again()):
                return found
        except (OdomError, OSError) as error:
            _LOG.debug("%s cannot be looked at: %s", source, error)
    reasons = Counter(report.get("lost_for", {})) or Counter(report.get("colour", {}).get("refused", {}))
    main = "".join(f"{count} frames: {reason}; " for reason, count in reasons.most_common(1))
    return f"{main}`odom doctor {source}` looks for the cause"


def _main_fault(opened: Source) -> str | None:
    from odom.evaluation.diagnosis import Verdict, examine
    from odom.service.source_sample import collect

    logging.disable()  # the run has told what the source leaves out
    try:
        recording = collect(opened.messages(), Topics(), _LOOKED_AT_S, lambda done: None, is_recorded=True)
        recording = replace(recording, refused={**recording.refused, **refused_images(opened)})
    finally:
        opened.close()
        logging.disable(logging.NOTSET)
    bad = (finding for finding in examine(recording) if finding.verdict is Verdict.BAD)
    return next((f"{finding.key}: {finding.value}: {finding.advice}" for finding in bad), None)
