"""How far the axis along which depth is measured is turned against the colour camera's: a degree or two.

Depth comes as z along the axis of the camera that measured it. Where that is turned by small angles against the colour
camera's, distances are too large on one side of the image and too small on the other: on a Kinect (TUM fr1) by 1.7 % at
the edges, several times the noise there. A landmark that wanders through the image seems to come nearer then, and the
camera with it. Seen at several places in the image, landmarks tell the tilt, and adjustments find it. Source: two axes,
geometry; that depth errs more by such fields than by noise: A. Teichman, S. Miller, S. Thrun, "Unsupervised intrinsic
calibration of depth sensors via SLAM", RSS 2013.
"""

import numpy as np

from odom.geometry.arrays import Array

TILTS = 2
"""Numbers of a tilt (rad): inverse depth is measured as smaller by their products with a ray's x/z and y/z."""
NO_TILT: Array = np.zeros(TILTS)
"""The tilt of depth that is measured along the colour camera's axis."""


def without_tilt(values: Array, tilt: Array) -> Array:
    """Return `values` (n x 3: x/z, y/z, 1/z; NaN without depth) as they would be measured without a `tilt` (2, rad)."""
    if not tilt.any():
        return values
    straight = values.copy()
    straight[:, 2] *= 1.0 + values[:, :2] @ tilt
    return straight


def by_tilt(values: Array) -> Array:
    """Return the derivative (n x 3 x 2) of `without_tilt` by the tilt, 0 without depth."""
    derivative = np.zeros((len(values), 3, TILTS))
    derivative[:, 2] = np.nan_to_num(values[:, 2:]) * values[:, :2]
    return derivative
