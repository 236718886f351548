"""What is assumed of the depth of features that have none: something between the scene and the horizon."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from odom.frontend.features.measurement import Measurements

_SAMPLED_EVERY = 8
"""Distance in pixels of the sample that tells how deep a scene is: 4,800 of a VGA image."""
_UNKNOWN_MM = 2000.0
"""Depth of the scene where the image shows none: half of a room's."""


def with_assumed_depth(measured: Measurements, depth_mm: NDArray[np.uint16]) -> Measurements:
    """Return what was `measured` of features of a view with `depth_mm`, with a depth also for those without.

    It is half of the scene's median inverse depth, with one sigma of as much: from there to infinity, since depth is
    missing mostly beyond the sensor's range. Inverse depth is nearly Gaussian also so far away (J. Civera, A. Davison,
    J. Montiel, "Inverse depth parametrization for monocular SLAM", IEEE T-RO 24, 2008).
    """
    lacks_depth = np.isnan(measured.values[:, 2])
    if not lacks_depth.any():
        return measured
    sample = depth_mm[::_SAMPLED_EVERY, ::_SAMPLED_EVERY]
    sample = sample[sample > 0]
    assumed = 500.0 / (float(np.median(sample)) if len(sample) else _UNKNOWN_MM)
    values, covariance, slope = measured.values.copy(), measured.covariance.copy(), measured.slope.copy()
    values[lacks_depth, 2], covariance[lacks_depth, 3], slope[lacks_depth] = assumed, assumed**2, 0.0
    return replace(measured, values=values, covariance=covariance, slope=slope)
