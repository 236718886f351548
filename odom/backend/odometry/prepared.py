"""What is computed from a colour image while its depth is still on the way."""

from dataclasses import dataclass

from odom.backend.tracking.posed_frame import PosedFrame
from odom.frame import RgbdFrame, Stamp
from odom.frontend.features.images import FrameImages
from odom.geometry.arrays import Array, Image


@dataclass(frozen=True, eq=False)
class Prepared:
    """A colour image as prepared for tracking, and `T_predicted`: T_camera_map as predicted from `last`."""

    stamp: Stamp
    color: Image
    images: FrameImages
    last: PosedFrame
    T_predicted: Array
    laps_ms: dict[str, float]

    def is_of(self, frame: RgbdFrame, last: PosedFrame | None) -> bool:
        """Return whether this was prepared for `frame`, to be tracked from `last`.

        The same array may hold another image by now: the stamp tells.
        """
        return self.color is frame.color and self.stamp == frame.stamp and self.last is last
