"""A calibration as text: values before and after, their uncertainty, and how well they explain the measurements."""

from collections.abc import Iterator

import numpy as np

from odom.calibration.held_out import Residuals
from odom.calibration.parameters import GROUPS, NAMES
from odom.calibration.result import Calibrated, Judgement

_AT_M = 2.0
"""Range at which errors of inverse depth are converted to millimetres."""


def numbers(result: Calibrated) -> Iterator[str]:
    """Yield a line for each parameter: before, now, one sigma, unit."""
    yield f"{'':<16}{'before':>11}{'now':>12}{'sigma':>10}"
    for group in GROUPS:
        for name in group.names:
            k = NAMES.index(name)
            now = f"{result.vector[k]:.5g} {result.sigma[k]:.2g}".split()
            words = f"{name:<16}{result.start[k]:>11.5g}{now[0]:>12}{now[1]:>10}  {group.unit}"
            stays = (
                "hardly shown by this walk" if result.vector[k] != result.start[k] else "not shown by this walk: stays"
            )
            yield words if result.shown[k] else f"{words}  ({stays})"


def quality(judgement: Judgement) -> Iterator[str]:
    """Yield the errors in held-out frames with the calibration before and after."""
    for words, found in (("as it was", judgement.before), ("calibrated", judgement.after)):
        yield f"{words}: {_of(found)}"


def _of(found: Residuals) -> str:
    mm = 1e3 * found.depth_per_m * _AT_M**2
    return f"corners off by {found.ray_px:.2f} px and depth by {mm:.1f} mm at {_AT_M:g} m (median, held-out frames)"


def registration(result: Calibrated) -> str:
    """Return in words where colour lies on depth, at one, two and four metres."""
    shift, baseline = np.array(result.camera.depth.shift_px), np.array(result.camera.depth.baseline_px_m)
    places = []
    for metres in (1.0, 2.0, 4.0):
        u, v = shift + baseline / metres
        places.append(f"{u:+.1f} px right and {v:+.1f} px below at {metres:g} m")
    return f"colour lies {'; '.join(places)} of depth"
