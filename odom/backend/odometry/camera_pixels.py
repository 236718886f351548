"""What leaves the odometry in pixels: taken back from the scaled images to the camera's own."""

from dataclasses import replace

from odom.backend.estimate import Estimate
from odom.frontend.features.image_scale import own_uv


def in_camera_pixels(estimate: Estimate, scale: float) -> Estimate:
    """Return an estimate by images whose sides were multiplied by `scale`, in pixels of the camera's own ones."""
    if scale == 1.0:
        return estimate
    features, moving = estimate.features, estimate.moving
    if features is not None:
        features = replace(features, uv=own_uv(features.uv, scale))
    if moving is not None:
        height, width = moving.image_shape
        moving = replace(moving, image_shape=(round(height / scale), round(width / scale)))
    return replace(estimate, features=features, moving=moving)
