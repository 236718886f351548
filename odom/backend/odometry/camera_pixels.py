"""What leaves the odometry in pixels: taken back from the enlarged images of a small camera to the camera's own."""

from dataclasses import replace

from odom.backend.estimate import Estimate, OnPose
from odom.backend.odometry.frame_stages import FrameStages
from odom.backend.stopwatch import Stopwatch
from odom.frontend.features.enlargement import own_uv
from odom.frontend.features.view import View
from odom.geometry.arrays import Array


def estimated(
    frames: FrameStages, view: View, T_predicted: Array | None, watch: Stopwatch, on_pose: OnPose
) -> Estimate:
    """Return what `FrameStages.estimate` does, and tell `on_pose` the same, in pixels of the camera's own images."""
    factor = view.images.factor
    if factor == 1:
        return frames.estimate(view, T_predicted, watch, on_pose)
    found = frames.estimate(view, T_predicted, watch, lambda estimate: on_pose(in_camera_pixels(estimate, factor)))
    return in_camera_pixels(found, factor)


def in_camera_pixels(estimate: Estimate, factor: int) -> Estimate:
    """Return an estimate by images that were enlarged by `factor`, in pixels of the camera's own ones."""
    features, moving = estimate.features, estimate.moving
    if features is not None:
        features = replace(features, uv=own_uv(features.uv, factor))
    if moving is not None:
        height, width = moving.image_shape
        moving = replace(moving, image_shape=(height // factor, width // factor))
    return replace(estimate, features=features, moving=moving)
