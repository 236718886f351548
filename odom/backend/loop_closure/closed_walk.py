"""The paper's test of a walk that ends where it began: the last frame registered against the first key frame."""

import numpy as np

from odom.backend.estimate import ClosingTest, RelativePose
from odom.backend.map.map import Map
from odom.backend.map.pose_covariance import independent_covariance
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.geometry import se3


def closing_test(
    map_: Map,
    tracker: FrameTracker,
    last: PosedFrame,
    pairwise: RelativePose | None,
    sensor: SensorModel,
) -> ClosingTest | None:
    """Compare the pose of the `last` frame in the trajectory with the one that the first key frame's landmarks give.

    The first key frame is that of its segment; `pairwise` is the last frame registered against the one before. Returns
    None where the last frame was not tracked or shows too little of what the first one did, or the first key frame is
    forgotten or from an earlier session.
    """
    first = map_.keyframes[map_.keyframes[last.reference].first]
    if last.tracked is None or first.number not in map_.remembered or first.number < map_.earlier_keyframes:
        return None
    tracked = tracker.track(last.view, sensor, last.T_camera_map, last.tracked.twist, np.array([first.number]))
    inliers = tracked.inlier_count
    if inliers < TUNING.found_again:
        return None
    T_direct = first.T_camera_map @ tracked.T_map_camera
    T_trajectory = first.T_camera_map @ last.T_map_camera
    away = se3.log(se3.inverse(T_trajectory) @ T_direct)
    covariance = independent_covariance(tracked.covariance * sensor.noise.covariance_scale)
    return ClosingTest(
        RelativePose(first.stamp, T_direct, covariance, inliers),
        T_trajectory,
        pairwise,
        float(np.linalg.norm(away[:3])),
        float(np.rad2deg(np.linalg.norm(away[3:]))),
        float(np.sqrt(away @ np.linalg.solve(covariance, away))),
    )
