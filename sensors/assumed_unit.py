"""Tells where the unit of depth images was assumed, and what they show speaks against it."""

import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from odom.frame.depth_model import LIKELY_MEDIAN_M
from sensors.image_lists import FolderLayout
from sensors.image_reading import image_in

log = logging.getLogger(__name__)

_MILLIMETRES, _TUM = 1000.0, 5000.0
"""Units a metre that depth images usually have; one is taken for the other where nothing says it."""
_FARTHEST_M = 5.0
"""Median of depth from which assumed millimetres are doubted, which TUM's units would make 1 m. Rooms seen from within
have 1 to 3 m. Smaller: halls are told; larger: rooms in TUM's units are not. Chosen by hand."""
_LOOKED_AT = 5
"""Depth images that are looked at, from all over the folder: one may be empty, or show one wall only."""


def tell_unlikely_unit(folder: Path, layout: FolderLayout, calibration_file: Path | None) -> None:
    """Log that no calibration file says the `depth_scale`, if depth is then nowhere likely.

    Images that cannot be read are passed over, as the source says so itself, and those in metres, whose unit is known.
    """
    medians = [] if layout.rotated_bits else list(_medians(folder, layout))
    if not medians:
        return
    middle_m = float(np.median(medians)) / layout.depth_scale
    farthest_m = _FARTHEST_M if layout.depth_scale == _MILLIMETRES else LIKELY_MEDIAN_M[1]
    if LIKELY_MEDIAN_M[0] < middle_m < farthest_m:
        return
    too_near = middle_m <= LIKELY_MEDIAN_M[0]
    log.warning(
        "%s says no depth_scale, so %g units a metre are taken%s, by which half of the depth images is %s %.2f m: that "
        "is unlikely, and a wrong unit makes the whole trajectory too %s; %s",
        folder if calibration_file is None else calibration_file,
        layout.depth_scale,
        " (millimetres)" if layout.depth_scale == _MILLIMETRES else "",
        "within" if too_near else "beyond",
        middle_m,
        "small" if too_near else "large",
        _remedy(folder, calibration_file, layout.depth_scale, too_near),
    )


def _remedy(folder: Path, calibration_file: Path | None, scale: float, too_near: bool) -> str:
    """Return in words which line to write into which file, for the unit that is likely then."""
    where = f"write a file {folder / 'camera.yaml'} with the line" if calibration_file is None else "add to it the line"
    if too_near and scale > _MILLIMETRES:
        return f"where depth is in millimetres, {where} depth_scale: {_MILLIMETRES:g}"
    if not too_near and scale < _TUM:
        return f"where depth has TUM's {_TUM:g} units a metre, {where} depth_scale: {_TUM:g}"
    return f"{where} depth_scale: and how many units of depth are a metre"


def _medians(folder: Path, layout: FolderLayout) -> Iterator[float]:
    """Yield the medians of some depth images' values, none of an image without depth, unreadable or in metres."""
    for entry in layout.depth[:: -(-len(layout.depth) // _LOOKED_AT) or 1]:
        depth = image_in(folder / entry.values[0])
        if depth is None or depth.dtype.kind == "f":
            continue
        seen = depth[(depth > 0) & (depth != layout.unknown_depth)]
        if seen.size:
            yield float(np.median(seen))
