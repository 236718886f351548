"""What is computed of a colour image while its depth is still on the way."""

from dataclasses import dataclass

from odom.backend.tracking.frame_state import FrameState
from odom.frontend.features.images import FrameImages
from odom.geometry.arrays import Array, Image


@dataclass(frozen=True, eq=False)
class Prepared:
    """What was computed of a colour image before its depth was there: T_camera_map as predicted from `state`."""

    color: Image
    images: FrameImages
    state: FrameState
    T_predicted: Array
    laps_ms: dict[str, float]
