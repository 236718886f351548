"""One frame as the odometry looks at it: in the camera's steady time, with the images that features are sought in."""

from dataclasses import dataclass, replace

from odom.frame import RgbdFrame, Stamp
from odom.frontend.clock import Clock
from odom.frontend.images import FrameImages


@dataclass(frozen=True, eq=False)
class View:
    """The frame whose colour image was stamped `stamp`; `frame` has that image's steady time instead (see `clock`)."""

    stamp: Stamp
    frame: RgbdFrame
    images: FrameImages

    @classmethod
    def of(cls, frame: RgbdFrame, clock: Clock, images: FrameImages) -> "View":
        """Return the view of a frame whose stamp is the newest of `clock`; `images` are those of its colour."""
        return cls(frame.stamp, replace(frame, stamp=clock.steady), images)

    @property
    def late_s(self) -> float:
        """By how much the stamp is later than the steady time."""
        return (self.stamp - self.frame.stamp) * 1e-9
