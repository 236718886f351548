"""The paper's test of a walk that ends where it began: the last frame registered against the first key frame."""

import numpy as np
from numpy.typing import NDArray

from odom.backend.belief import LEAST_FOUND_AGAIN
from odom.backend.estimate import ClosingTest, RelativePose
from odom.backend.history import long_after
from odom.backend.keyframes import Keyframe
from odom.backend.mapper import Mapper
from odom.backend.selfcheck import SelfCheck
from odom.frontend.view import View
from odom.registration import se3

Array = NDArray[np.float64]


def closing_test(
    mapper: Mapper,
    first: Keyframe,
    view: View,
    T_camera_map: Array,
    twist: Array,
    pairwise: RelativePose | None,
    check: SelfCheck,
) -> ClosingTest | None:
    """Compare where the trajectory has the last `view` with where the `first` key frame of its segment sees it.

    `twist` (6, SI) is its motion and `pairwise` the one since the frame before. Returns None where the view does not
    show what the first key frame did, or that one is forgotten.
    """
    if first.number not in mapper.map.remembered:
        return None
    tracked = mapper.track_against(np.array([first.number]), view, T_camera_map, twist, check.noise)
    inliers = tracked.inlier_count
    if inliers < LEAST_FOUND_AGAIN:
        return None
    T_direct = first.T_camera_map @ se3.inverse(tracked.T_camera_map)
    T_trajectory = first.T_camera_map @ se3.inverse(T_camera_map)
    away = se3.log(se3.inverse(T_trajectory) @ T_direct)
    covariance = long_after(tracked.covariance * check.scale)
    return ClosingTest(
        RelativePose(first.stamp, T_direct, covariance, inliers),
        T_trajectory,
        pairwise,
        float(np.linalg.norm(away[:3])),
        float(np.rad2deg(np.linalg.norm(away[3:]))),
        float(np.sqrt(away @ np.linalg.solve(covariance, away))),
    )
