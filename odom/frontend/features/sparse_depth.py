"""Depth images whose measured pixels lie apart, with the gaps between them filled.

Depth that is carried, pixel by pixel, into a colour image of more pixels is such (ROS's `depth_image_proc/register`,
the small depth image of a time-of-flight camera, the lines of a lidar): few pixels of it are measured, but all over
what the sensor sees. A plane can be fitted to none of its neighbourhoods as they are (`read_planes`).
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frontend.features.image_scale import scaled_depth
from odom.frontend.features.tuning import TUNING

_SAMPLED_EVERY = 5.0 * (1.0 + 5.0**0.5) / 2.0
"""Distance of the sampled rows and columns that tell whether measured pixels have neighbours, 60 of 480 rows. It is no
ratio of whole numbers, so that no regular pattern of measured pixels is met always or never."""
_COUNTED_EVERY = 8
"""Of so many measured pixels, the neighbourhood of one is looked at."""
_NEIGHBOURHOOD_PX = 33
"""Side of the square in which measured pixels are counted: it holds two lines of a depth image filled at all."""


def dense_depth(depth_mm: NDArray[np.uint16], scale: float) -> NDArray[np.uint16]:
    """Return a depth image (H x W, 0: none) in the size in which features are looked for, without gaps if it is sparse.

    `scale` is that of its colour image (see `image_scale`).
    """
    if not is_sparse(depth_mm):
        return scaled_depth(depth_mm, scale)
    reduced = scaled_depth(depth_mm, min(scale, 1.0), whole_blocks=True)
    return scaled_depth(_filled(reduced), max(scale, 1.0))


def without_gaps(depth_mm: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return a depth image (H x W, 0: none) with its gaps filled if it is sparse, otherwise the very one."""
    return _filled(depth_mm) if is_sparse(depth_mm) else depth_mm


def is_sparse(depth_mm: NDArray[np.uint16]) -> bool:
    """Return whether most measured pixels of a depth image (H x W, 0: none) have no measured neighbour on a side.

    A dense image has holes, but most of its pixels lie within what is measured.
    """
    for image in (depth_mm, depth_mm.T):
        is_measured = image[np.arange(0.0, len(image), _SAMPLED_EVERY).astype(np.intp)] > 0
        measured = np.count_nonzero(is_measured[:, :-1])
        if np.count_nonzero(is_measured[:, :-1] & is_measured[:, 1:]) < TUNING.depth_sparse_share * measured:
            return True
    return False


def _filled(depth_mm: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return a sparse depth image (H x W, 0: none) whose gaps have the depth of the nearest measured pixel.

    As far as half of the usual distance between measured pixels and a little more, and no farther than
    `depth_fill_px`: holes that are wider than the gaps stay. Where most measured pixels do not agree with the next one,
    they are a sensor's noise and not a scene's surfaces: the image is returned as it is.
    """
    is_measured = depth_mm > 0
    measured = np.flatnonzero(is_measured)
    if not len(measured):
        return depth_mm
    around = cv2.blur(is_measured.astype(np.float32), (_NEIGHBOURHOOD_PX, _NEIGHBOURHOOD_PX))
    spacing_px = 1.0 / np.sqrt(float(np.median(around.ravel()[measured[::_COUNTED_EVERY]])))
    gaps = np.asarray(~is_measured, dtype=np.uint8)
    away_px, labels = cv2.distanceTransformWithLabels(
        gaps, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    nearest = np.asarray(labels, dtype=np.intp)
    depth_of = np.zeros(len(measured) + 1, dtype=np.uint16)  # labels count from 1
    depth_of[nearest.ravel()[measured]] = depth_mm.ravel()[measured]
    everywhere = depth_of.take(nearest)
    if not _agree(depth_mm, everywhere, round(spacing_px)):
        return depth_mm
    reach_px = min(TUNING.depth_fill_spacings * spacing_px, TUNING.depth_fill_px)
    return np.asarray(everywhere * (away_px <= reach_px), dtype=np.uint16)


def _agree(depth_mm: NDArray[np.uint16], everywhere: NDArray[np.uint16], step_px: int) -> bool:
    """Return whether most measured pixels are about as far away as what is nearest to `step_px` to their right."""
    is_measured = depth_mm[:, :-step_px] > 0
    here, beside = (each[is_measured].astype(np.float32) for each in (depth_mm[:, :-step_px], everywhere[:, step_px:]))
    return bool(np.count_nonzero(np.abs(here - beside) > TUNING.depth_fill_apart * here) <= 0.5 * len(here))
