"""A survey's residuals against a camera, in x/z, y/z, 1/z.

Residuals are those of the image (pixel, inverse depth as measured), carried by derivatives at the predicted point.
Carrying the measured points themselves would let a longer focal length or a larger scale make every residual smaller.
"""

from dataclasses import dataclass

import numpy as np

from odom.backend.mapping.bundle_adjustment import Bundle
from odom.calibration.parameters import DEPTH, LENS, OFFSET, SCALE, TIMINGS, vector_of
from odom.calibration.projection import project
from odom.calibration.survey import Survey
from odom.frame.depth_model import aside_px
from odom.geometry.arrays import Array

_NEAREST_M = 0.05
"""Least predicted depth: the adjustment refuses a landmark that comes nearer."""


@dataclass(frozen=True, eq=False)
class Linearised:
    """N observations as predicted and as measured.

    `predicted` and `values` (N x 3): x/z, y/z, 1/z; `variances` (N x 4) as in `Measurements`.
    """

    predicted: Array
    values: Array
    variances: Array

    @property
    def residuals(self) -> Array:
        """What `values` exceed the prediction by (N x 3)."""
        return np.asarray(self.values - self.predicted)


def linearised(survey: Survey, vector: Array, bundle: Bundle) -> Linearised:
    """Return the residuals at the camera's `vector` (30) and at the poses and landmarks of `bundle`."""
    T = bundle.T_camera_map[survey.frame]
    points = np.einsum("nij,nj->ni", T[:, :3, :3], bundle.landmarks[survey.landmark]) + T[:, :3, 3]
    w = 1.0 / np.maximum(points[:, 2], _NEAREST_M)
    xy = points[:, :2] * w[:, None]
    uv, by_direction = project(xy, vector[LENS])
    to_direction = np.linalg.inv(by_direction)
    terms = survey.terms
    offset, scale = terms @ vector[OFFSET], terms @ vector[SCALE]
    moved = vector - vector_of(survey.camera)
    shift = aside_px(moved[DEPTH], survey.uv, w, survey.camera.width, survey.camera.height)
    measured = survey.inverse_depth - np.einsum("nc,nc->n", survey.slope, shift)

    values = np.empty((len(survey), 3))
    values[:, :2] = xy + np.einsum("nij,nj->ni", to_direction, survey.uv - uv)
    values[:, 2] = w + (measured - (offset + scale * w)) / scale
    values += survey.by_timing @ vector[:TIMINGS]
    uu, across, vv = survey.variance_uv.T
    C = np.stack([uu, across, across, vv], axis=1).reshape(-1, 2, 2)
    S = to_direction @ C @ to_direction.transpose(0, 2, 1)
    variances = np.column_stack([S[:, 0, 0], S[:, 0, 1], S[:, 1, 1], survey.variance_depth / scale**2])
    predicted = np.column_stack([xy, w])
    return Linearised(predicted, values, variances)


def chi_squared(lines: Linearised) -> tuple[Array, Array]:
    """Return the squared normalised residuals (N) of ray and of depth (NaN: none)."""
    x, y, w = lines.residuals.T
    xx, across, yy, ww = lines.variances.T
    ray = (yy * x * x - 2.0 * across * x * y + xx * y * y) / (xx * yy - across * across)
    return np.asarray(ray), np.asarray(w * w / ww)
