"""The Cramer-Rao bound of a registration: no unbiased estimator has less error on average."""

import numpy as np

from odom.geometry.arrays import Array
from odom.registration import Pairs


def point_jacobians(T: Array, points_source: Array) -> Array:
    """Return d (R q + t) / d (rho, phi) at `T @ exp(xi)` for n source points: n x 3 x 6, `[R, -R hat(q)]`."""
    R = np.broadcast_to(T[:3, :3], (len(points_source), 3, 3))
    return np.concatenate([R, np.cross(points_source[:, None], R)], axis=2)


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
    return np.asarray(np.linalg.inv(J.reshape(-1, 6).T @ (np.linalg.inv(S) @ J).reshape(-1, 6)))


def bound_rmse(T: Array, pairs: Pairs) -> float:
    """Return the bound on the RMSE (m) of the moved source points against the noise-free targets."""
    J = point_jacobians(T, pairs.points_source)
    return float(np.sqrt((J @ bound_covariance(T, pairs) * J).sum() / len(pairs)))
