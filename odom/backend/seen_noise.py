"""What a tracked frame shows of the noise: its residuals, and how far the image's two halves disagree."""

import numpy as np

from odom.backend.map import Map
from odom.backend.pose import fit_pose
from odom.backend.selfcheck import SelfCheck
from odom.backend.tracking import INLIER_CHI2, Tracked
from odom.registration import se3


def after_frame(check: SelfCheck, map_: Map, tracked: Tracked, width: int) -> SelfCheck:
    """Return the check after one more tracked frame, whose image is `width` pixels wide."""
    chosen = tracked.inliers & (tracked.chi2[:, 1] < INLIER_CHI2)
    check = check.with_residuals(tracked.chi2[chosen], tracked.measurements.values[chosen, 2])
    nees = disagreement(map_, tracked, width)
    return check if nees is None else check.with_disagreement(nees)


def disagreement(map_: Map, tracked: Tracked, width: int) -> float | None:
    """Return the NEES (6 expected) of the difference between the poses that the image's two halves give.

    None where one of them, left or right, holds too little.
    """
    L = map_.landmarks
    fits = []
    is_left = tracked.uv[:, 0] < width / 2
    for half in (is_left, ~is_left):
        chosen = tracked.inliers & half
        if np.count_nonzero(chosen) < 40:
            return None
        rows = tracked.rows[chosen]
        m = tracked.measurements.take(chosen)
        fits.append(fit_pose(L.position[rows], L.covariance[rows], m.values, m.covariance, tracked.T_camera_map))
    away = se3.log(fits[0].T_camera_map @ se3.inverse(fits[1].T_camera_map))
    S = np.linalg.inv(fits[0].information) + np.linalg.inv(fits[1].information)
    return float(away @ np.linalg.solve(S, away))
