"""What leaves the odometry in pixels: taken back from the scaled images to the camera's own."""

from dataclasses import replace

from odom.backend.estimate import Estimate, OnPose
from odom.backend.odometry.frame_stages import FrameStages
from odom.backend.stopwatch import Stopwatch
from odom.frontend.features.image_scale import own_uv
from odom.frontend.features.view import View
from odom.geometry.arrays import Array


def estimated(
    frames: FrameStages, view: View, T_predicted: Array | None, watch: Stopwatch, on_pose: OnPose
) -> Estimate:
    """Return what `FrameStages.estimate` does, and tell `on_pose` the same, in pixels of the camera's own images."""
    scale = view.images.scale
    if scale == 1.0:
        return frames.estimate(view, T_predicted, watch, on_pose)
    found = frames.estimate(view, T_predicted, watch, lambda estimate: on_pose(in_camera_pixels(estimate, scale)))
    return in_camera_pixels(found, scale)


def in_camera_pixels(estimate: Estimate, scale: float) -> Estimate:
    """Return an estimate by images whose sides were multiplied by `scale`, in pixels of the camera's own ones."""
    features, moving = estimate.features, estimate.moving
    if features is not None:
        features = replace(features, uv=own_uv(features.uv, scale))
    if moving is not None:
        height, width = moving.image_shape
        moving = replace(moving, image_shape=(round(height / scale), round(width / scale)))
    return replace(estimate, features=features, moving=moving)
