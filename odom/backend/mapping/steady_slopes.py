"""The slope of a landmark's surface, the same in all frames that see it, and the timing's derivatives that follow.

How the depth of a feature changes with the time at which it is read depends on the slope there. The slope read in one
frame is noisy, at edges above all, and noise in a derivative makes what is fitted by it too small (errors in
variables: W. Fuller, "Measurement error models", 1987): where the lag of depth was expected 15 ms too short, only half
of that was found on fr1. So all frames that see a landmark share one normal of its surface.
"""

from dataclasses import replace

import numpy as np

from odom.frontend.features.measurement import Measurements
from odom.geometry.arrays import Array, Index

_LEAST_ROW = 1e-3
"""Share of the image's height: rows that are nearer to the middle one tell nothing of rates."""


def steady_rise(values: Array, rise: Array, R_camera_map: Array, landmark: Index) -> Array:
    """Return the slope of inverse depth (N x 2, 1/m for each unit of x/z, y/z) if each surface has a single normal.

    `values` (N x 3: x/z, y/z, 1/z) and `rise` (N x 2, the slope) are as measured in single frames of rotation
    `R_camera_map` (N x 3 x 3), of the landmarks with numbers `landmark` (N). NaN where no depth was measured.
    """
    x, y, w = values.T
    normal = np.column_stack([rise, w - x * rise[:, 0] - y * rise[:, 1]])
    in_map = np.einsum("nij,ni->nj", R_camera_map, normal / np.linalg.norm(normal, axis=1, keepdims=True))
    mean = np.zeros((int(landmark.max(initial=-1)) + 1, 3))
    np.add.at(mean, landmark, np.nan_to_num(in_map))
    normal = np.einsum("nij,nj->ni", R_camera_map, mean[landmark])
    facing = normal[:, 0] * x + normal[:, 1] * y + normal[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(normal[:, :2] * (w / facing)[:, None])


def with_rise(jacobian_timing: Array, change: Array, half_readout: Array) -> Array:
    """Return the derivatives by the timing (N x 3 x 3, see `Measurements`) after the rise changed by `change` (N x 2).

    The feature's row and velocity are found from them; `half_readout` (N) is the timing's. Where `change` is not
    finite, or the row tells no rate, they stay.
    """
    J = jacobian_timing.copy()
    with np.errstate(divide="ignore", invalid="ignore"):
        row = J[:, 2, 2] / J[:, 2, 1]
        by_lag = (-J[:, :2, 0] / row[:, None] * change).sum(axis=1)
    is_known = np.isfinite(by_lag) & (np.abs(row) > _LEAST_ROW)
    by_lag, row = np.where(is_known, by_lag, 0.0), np.where(is_known, row, 0.0)
    J[:, 2, 0] += (half_readout - row) * by_lag
    J[:, 2, 1] += by_lag
    J[:, 2, 2] += row * by_lag
    return J


def steadied(
    measured: Measurements, R_camera_map: Array, landmark: Index, half_readout: Array, focal_px: Array
) -> Measurements:
    """Return measurements (N) with derivatives by the timing as if each surface had a single normal.

    `R_camera_map` (N x 3 x 3) and `landmark` (N) as in `steady_rise`, `half_readout` (N) is that of the timing each
    was measured by; `focal_px` (2: fx, fy) is the lens's.
    """
    rise = measured.slope * focal_px
    steady = steady_rise(measured.values, rise, R_camera_map, landmark)
    return replace(measured, jacobian_timing=with_rise(measured.jacobian_timing, steady - rise, half_readout))
