"""Whether to believe the pose of a frame, and what to say of it."""

import numpy as np
from numpy.typing import NDArray

from odom.backend.estimate import State
from odom.backend.tracking import Tracked

Array = NDArray[np.float64]

_LEAST_INLIERS, _SURE_INLIERS = 15, 30
_LEAST_SHARE_LEFT = 0.25
"""Landmarks do not vanish all at once: where fewer than this share of the last frame's is left, the view jumped."""
_UNSURE_M, _UNSURE_RAD = 0.05, np.deg2rad(2.0)
"""One sigma along the least certain direction."""
LEAST_FOUND_AGAIN = 30
_SHARE_IN_CHAIN, _SHARE_WITHOUT_CHAIN = 0.2, 0.35
"""Of the landmarks looked for, what must be found again: less where the chain of key frames agrees as well."""
_FASTEST_M_S, _FASTEST_RAD_S = 5.0, 12.0


def is_carried(twist: Array) -> bool:
    """Say whether something carried by a person, or driving, can move so (6, m/s and rad/s)."""
    return bool(np.linalg.norm(twist[:3]) < _FASTEST_M_S and np.linalg.norm(twist[3:]) < _FASTEST_RAD_S)


def is_enough(tracked: Tracked) -> bool:
    """Say whether a pose found by so few landmarks may be one at all."""
    return tracked.inlier_count >= _LEAST_INLIERS


def is_same_view(tracked: Tracked, previous: Tracked | None) -> bool:
    """Say whether enough is left of what the `previous` frame saw (None: it began a segment)."""
    return tracked.inlier_count >= _LEAST_SHARE_LEFT * (0 if previous is None else previous.inlier_count)


def is_known_place(tracked: Tracked, is_chained: bool = False) -> bool:
    """Say whether a frame shows what its key frames saw; `is_chained` where their chain has to agree besides."""
    share = _SHARE_IN_CHAIN if is_chained else _SHARE_WITHOUT_CHAIN
    return tracked.found_again >= max(LEAST_FOUND_AGAIN, share * tracked.looked_for)


def verdict(tracked: Tracked, covariance: Array, is_recovered: bool, is_shallow: bool) -> tuple[State, str]:
    """Return the state of a frame that was placed, and the reason where it is not TRACKING.

    `covariance` is the pose's (6 x 6, `se3`); `is_recovered`: after a loss; `is_shallow`: for a while without depth.
    """
    inliers = tracked.inlier_count
    if is_recovered:
        return State.RECOVERED, f"place recognised: {inliers} landmarks found again"
    if inliers < _SURE_INLIERS:
        return State.UNCERTAIN, f"only {inliers} landmarks found again"
    sigma_m, sigma_rad = (float(np.sqrt(np.linalg.eigvalsh(C)[-1])) for C in (covariance[:3, :3], covariance[3:, 3:]))
    if sigma_m > _UNSURE_M or sigma_rad > _UNSURE_RAD:
        return State.UNCERTAIN, f"known to {100.0 * sigma_m:.0f} cm and {np.rad2deg(sigma_rad):.1f} deg only"
    if is_shallow:
        return State.UNCERTAIN, "hardly any depth: tracked by known landmarks alone"
    return State.TRACKING, ""
