"""Whether depth is mirrored or upside down against colour: drivers have a separate setting for each stream."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from odom.evaluation.diagnosis.edges import EdgeShift
from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.frame import RgbdFrame

_SURE, _SURER = 6.0, 1.15
"""Contrast of edges that match, and how many times that of depth as it is: wrong ways to turn the depth of fr1_xyz and
fr1_rpy (TUM) have 2 to 5, the right one 6 to 15."""
_NEAR_PX = 8.0
"""Largest shift of edges that are turned back correctly: by chance they match at any shift."""

_TURNED: dict[str, tuple[slice, slice]] = {
    "mirrored left to right": np.s_[:, ::-1],
    "turned by 180 degrees": np.s_[::-1, ::-1],
    "mirrored top to bottom": np.s_[::-1, :],
}


def judge_orientation(
    frames: Sequence[RgbdFrame], as_it_is: EdgeShift | None, shift_of: Callable[[Sequence[RgbdFrame]], EdgeShift | None]
) -> list[Finding]:
    """Return the finding that depth is mirrored or turned, nothing where no way of undoing that fits clearly.

    `as_it_is` is the shift of depth edges in the frames, `shift_of` finds that of others.
    """
    if as_it_is is not None and as_it_is.contrast >= _SURE:
        return []
    least = max(_SURE, _SURER * (as_it_is.contrast if as_it_is else 0.0))
    for name, back in _TURNED.items():
        turned = [replace(frame, depth_mm=np.ascontiguousarray(frame.depth_mm[back])) for frame in frames]
        found = shift_of(turned)
        if found is not None and found.contrast > least and np.hypot(*found.shift_px) < _NEAR_PX:
            advice = "set mirroring alike for both streams in the driver, or turn one of the images before it is sent"
            return [Finding("depth orientation", f"depth is {name} against colour", Verdict.BAD, advice)]
    return []
