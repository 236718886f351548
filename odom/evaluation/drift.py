"""A first-order model of how an odometry's errors drift, learnt from the errors, and the filter that whitens them.

The error of a pose is a share of the previous pose's error, carried along by the camera's motion, plus something new
(D. Cochrane and G. Orcutt, "Application of least squares regression to relationships containing auto-correlated error
terms", 1949). The share is a single number, so that the model is the same in whichever frame on the camera the errors
are given. What is new has a full 6 x 6 covariance, because rotation and translation err together: to a camera, a small
turn looks like a small step.
"""

from dataclasses import dataclass

import numpy as np

from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.normal_distribution import NORMAL_MAD

_WILD = 5.0 * NORMAL_MAD
"""Errors are clipped at five standard deviations: fewer clip the drift itself, more let jumps of the truth in."""


@dataclass(frozen=True, eq=False)
class Whitener:
    """Makes errors of n poses (twists in the camera's frame) white and of unit variance.

    `kept` (n - 1 x 6 x 6) maps a pose's error onto its share in the next one's; `inverse_root` (6 x 6) whitens
    the rest, which is new.
    """

    kept: Array
    inverse_root: Array

    @classmethod
    def alike(cls, count: int, sigma: float) -> "Whitener":
        """Return the whitener of `count` independent errors of one standard deviation (m and rad)."""
        return cls(np.zeros((count - 1, 6, 6)), np.eye(6) / sigma)

    @classmethod
    def fit(cls, errors: Array, T_world_camera: Array) -> "Whitener":
        """Fit the model to n x 6 errors of n poses (n x 4 x 4) by least squares, with wild errors clipped."""
        limit = _WILD * np.median(np.abs(errors), axis=0) + 1e-12
        clipped = np.clip(errors, -limit, limit)
        carried = np.array([se3.adjoint(T) for T in se3.inverses(T_world_camera[1:]) @ T_world_camera[:-1]])
        past, now = (carried @ clipped[:-1, :, None])[:, :, 0], clipped[1:]
        root = _inverse_root(now - past)
        white_past, white_now = past @ root.T, now @ root.T
        share = (white_past * white_now).sum() / (np.square(white_past).sum() + 1e-18)
        return cls(share * carried, _inverse_root(now - share * past))

    def __call__(self, columns: Array) -> Array:
        """Return n - 1 x 6 x k white columns of n x 6 x k; the first row, which has no past, is left out."""
        return np.asarray(self.inverse_root @ (columns[1:] - self.kept @ columns[:-1]))


def _inverse_root(rows: Array) -> Array:
    covariance = rows.T @ rows / len(rows)
    covariance += np.diag(1e-6 * np.diag(covariance) + 1e-18)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))
