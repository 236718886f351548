"""The paper's test of a walk that ends where it began: the last frame registered against the first key frame."""

import numpy as np

from odom.backend.belief import LEAST_FOUND_AGAIN
from odom.backend.estimate import ClosingTest, RelativePose
from odom.backend.history import long_after
from odom.backend.mapper import Mapper
from odom.backend.selfcheck import SelfCheck
from odom.backend.tracking import Tracked
from odom.backend.whereabouts import Whereabouts
from odom.registration import se3


def closing_test(mapper: Mapper, was: Whereabouts, last: Tracked, check: SelfCheck) -> ClosingTest | None:
    """Compare where the trajectory has the `last` frame with where the first key frame of its segment sees it.

    Returns None where it does not show what the first key frame did, or that one is forgotten.
    """
    keyframes = mapper.map.keyframes
    first = keyframes[keyframes[was.near].first]
    if first.number not in mapper.map.remembered:
        return None
    view, near = was.previous.view, np.array([first.number])
    tracked = mapper.track_against(near, view, was.T_camera_map, last.twist, check.noise)
    inliers = tracked.inlier_count
    if inliers < LEAST_FOUND_AGAIN:
        return None
    T_direct = first.T_camera_map @ se3.inverse(tracked.T_camera_map)
    T_trajectory = first.T_camera_map @ se3.inverse(was.T_camera_map)
    away = se3.log(se3.inverse(T_trajectory) @ T_direct)
    covariance = long_after(tracked.covariance * check.scale)
    return ClosingTest(
        RelativePose(first.stamp, T_direct, covariance, inliers),
        T_trajectory,
        was.previous.pairwise,
        float(np.linalg.norm(away[:3])),
        float(np.rad2deg(np.linalg.norm(away[3:]))),
        float(np.sqrt(away @ np.linalg.solve(covariance, away))),
    )
