"""Images that come twice: from a driver that hangs, or in a stream that was brought to a higher rate."""

import numpy as np

from odom.backend.odometry.tuning import TUNING
from odom.backend.tracking.frame_state import FrameState
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.view import View
from odom.geometry.arrays import Image


def is_repeated(view: View, state: FrameState, sensor: SensorModel) -> bool:
    """Return whether the view holds the image of the newest frame with a pose once more, though the camera moves.

    It would say that the camera has stopped. Two images of a real camera differ, if only by their noise; drawn ones of
    a camera at rest do not, and are no repetition.
    """
    last, image = state.view.images.full, view.images.full
    if state.tracked is None or last.shape != image.shape or not _are_equal(last, image):
        return False
    inverse_depth = state.tracked.measurements.values[:, 2]
    near = np.median(inverse_depth[np.isfinite(inverse_depth)]) if np.isfinite(inverse_depth).any() else 0.0
    speed_m_s, speed_rad_s = np.linalg.norm(state.twist.reshape(2, 3), axis=1)
    focal_px = sensor.lens.intrinsics[0]
    moved_px = focal_px * (speed_rad_s + speed_m_s * near) * state.since_s(view.steady_stamp)
    return bool(moved_px > TUNING.repeated_px)


def _are_equal(a: Image, b: Image) -> bool:
    middle = len(a) // 2  # of different images one row is, too
    return np.array_equal(a[middle], b[middle]) and np.array_equal(a, b)
