"""What is possible: the Cramer-Rao bound of a registration."""

import numpy as np
from numpy.typing import NDArray

from odom.registration import Pairs

Array = NDArray[np.float64]


def point_jacobians(T: Array, points_source: Array) -> Array:
    """Return d (R q + t) / d (rho, phi) at `T @ exp(xi)` for n source points: n x 3 x 6, `[R, -R hat(q)]`."""
    R = T[:3, :3]
    n = len(points_source)
    hat = np.zeros((n, 3, 3))
    x, y, z = points_source.T
    hat[:, 0, 1], hat[:, 0, 2] = -z, y
    hat[:, 1, 0], hat[:, 1, 2] = z, -x
    hat[:, 2, 0], hat[:, 2, 1] = -y, x
    J = np.empty((n, 3, 6))
    J[:, :, :3] = R
    J[:, :, 3:] = -R @ hat
    return J


def bound_covariance(T: Array, pairs: Pairs) -> Array:
    """Return the smallest covariance (6 x 6, `se3` convention) an unbiased estimator of `T` can have.

    `pairs` holds the TRUE source points and the true covariances of the noise on either side.
    """
    R = T[:3, :3]
    S = np.zeros((len(pairs), 3, 3))
    if pairs.covariances_target is not None:
        S += pairs.covariances_target
    if pairs.covariances_source is not None:
        S += R @ pairs.covariances_source @ R.T
    J = point_jacobians(T, pairs.points_source)
    return np.asarray(np.linalg.inv(np.einsum("nji,njk,nkl->il", J, np.linalg.inv(S), J)))


def bound_rmse(T: Array, pairs: Pairs) -> float:
    """Return the bound on the RMSE (m) of the moved source points against the noise-free targets."""
    J = point_jacobians(T, pairs.points_source)
    return float(np.sqrt(np.einsum("nij,jk,nik->", J, bound_covariance(T, pairs), J) / len(pairs)))
