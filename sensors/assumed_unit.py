"""Tells where the unit of depth images was assumed, and what they show speaks against it."""

import logging
from pathlib import Path

import cv2
import numpy as np

from odom.frame.depth_model import LIKELY_MEDIAN_M
from sensors.image_lists import FolderLayout
from sensors.image_reading import image_in

log = logging.getLogger(__name__)


def tell_unlikely_unit(folder: Path, layout: FolderLayout, calibration_file: Path) -> None:
    """Log that a calibration file says no `depth_scale`, if half of the first depth image is then nowhere likely.

    Images that cannot be read are passed over: the source says so itself.
    """
    if layout.rotated_bits:
        return
    middle_m = _median(folder, layout) / layout.depth_scale
    if LIKELY_MEDIAN_M[0] < middle_m < LIKELY_MEDIAN_M[1] or not middle_m:
        return
    log.warning(
        "%s says no depth_scale, so %g units a metre are taken, by which half of the first depth image is within "
        "%.2f m: that is unlikely; where depth is in millimetres, add the line depth_scale: 1000",
        calibration_file, layout.depth_scale, middle_m,
    )  # fmt: skip


def _median(folder: Path, layout: FolderLayout) -> float:
    """Return the median of the first depth image's values, 0 where it holds none, cannot be read or is in metres."""
    depth = image_in(folder / layout.depth[0].values[0], cv2.IMREAD_UNCHANGED) if layout.depth else None
    if depth is None or depth.dtype.kind == "f":
        return 0.0
    seen = depth[(depth > 0) & (depth != layout.unknown_depth)]
    return float(np.median(seen)) if seen.size else 0.0
