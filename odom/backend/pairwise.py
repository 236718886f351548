"""The paper's chain: every frame registered against the one before it, C_i against C_i+1, and nothing else."""

import numpy as np
from numpy.typing import NDArray

from odom.backend.causal import Publication
from odom.backend.estimate import RelativePose
from odom.backend.tracking import Tracked
from odom.frontend.measure import points_of
from odom.registration import se3
from odom.registration.default import register
from odom.registration.pairs import Pairs, Prior

Array = NDArray[np.float64]

_LEAST_PAIRS = 10


def register_successive(
    previous: Tracked,
    T_previous_map: Array,
    published_previous: Publication,
    current: Tracked,
    published: Publication,
    scale: float,
    jitter_s: float,
) -> RelativePose | None:
    """Return T_previous_current from the features that both frames measured with depth, None where that fails.

    The recursive robust filter sees both clouds' covariances; the motion in the map as it is now, where the previous
    frame is at `T_previous_map`, serves as a hint to its gate only. To
    its covariance, times the self-check's `scale`, comes how far the camera goes while two stamps jitter by `jitter_s`;
    from the middle rows' times it is carried to the stamps as the two publications are.
    """
    _, a, b = np.intersect1d(previous.rows, current.rows, assume_unique=True, return_indices=True)
    deep = (previous.measurements.values[a, 2] > 0.0) & (current.measurements.values[b, 2] > 0.0)
    a, b = a[deep], b[deep]
    if len(a) < _LEAST_PAIRS:
        return None
    points_previous, covariances_previous = points_of(previous.measurements.take(a))
    points_current, covariances_current = points_of(current.measurements.take(b))
    pairs = Pairs(points_current, points_previous, covariances_current, covariances_previous)
    hint = Prior(T_previous_map @ se3.inverse(current.T_camera_map))
    registration = register(pairs, hint)
    if not registration.ok:
        return None
    inliers = int(registration.inliers.sum())
    covariance = scale * registration.covariance + 2.0 * jitter_s**2 * np.outer(current.twist, current.twist)
    covariance += published_previous.covariance_middle_stamp + published.covariance_middle_stamp
    T_middles = registration.T_target_source
    T_previous_current = se3.inverse(published_previous.T_middle_stamp) @ T_middles @ published.T_middle_stamp
    return RelativePose(published_previous.placed.stamp, T_previous_current, covariance, inliers)
