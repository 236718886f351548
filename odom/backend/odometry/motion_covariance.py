"""The covariances of published poses and motions: of the map, of doubt, and of the delays that all stamps share."""

import numpy as np

from odom.backend.doubt import Doubt
from odom.backend.map.frame_log import LoggedFrame
from odom.backend.map.map import Map
from odom.backend.map.pose_covariance import covariance_since_start, relative_covariance
from odom.backend.odometry.odom_in_map import Origin
from odom.backend.published_pose import PublishedPose
from odom.frontend.camera.sensor_model import SensorModel
from odom.geometry import se3
from odom.geometry.arrays import Array


def covariance_of_motion(
    map_: Map, earlier: PublishedPose, frame: LoggedFrame, T_earlier_current: Array, doubt: Doubt, sensor: SensorModel
) -> Array | None:
    """Return the 6 x 6 covariance of the motion from an earlier published pose to the `frame` that is published now.

    None where it is not known. `doubt` is the one at that frame.
    """
    shared = sensor.noise.calibration_error, sensor.since_middle_variance
    covariance = relative_covariance(map_, earlier.frame, frame, T_earlier_current, *shared)
    return None if covariance is None else covariance + doubt.since(earlier.doubt, T_earlier_current)


def covariance_of_pose(
    map_: Map,
    corrected: PublishedPose | None,
    origin: Origin | None,
    frame: LoggedFrame,
    T_odom_camera: Array,
    doubt: Doubt,
    sensor: SensorModel,
) -> Array | None:
    """Return the 6 x 6 covariance of the pose of a `frame` in odom since its segment began, None where not known.

    From `corrected`, the last pose published before the map was corrected, it only grows. `origin` is where odom
    begins.
    """
    if corrected is not None and corrected.covariance is not None:
        T_earlier_current = se3.inverse(corrected.T_odom_camera) @ T_odom_camera
        moved = covariance_of_motion(map_, corrected, frame, T_earlier_current, doubt, sensor)
        if moved is not None:
            return se3.compose_covariance(corrected.covariance, T_earlier_current, moved)
    covariance = covariance_since_start(map_.keyframes, frame, sensor.noise.calibration_error)
    if covariance is None:
        return None
    covariance = covariance + doubt.since(Doubt(), np.eye(4))
    if origin is None or frame.twist is None or origin.segment != frame.segment:
        return covariance
    return covariance + origin.covariance_to(T_odom_camera, frame.twist, sensor.since_middle_variance)
