"""Which frames are refused: of another size, out of order, or stamped in another unit."""

from odom.backend.map.frame_log import FrameLog
from odom.backend.odometry.tuning import TUNING
from odom.errors import InputError, check_type
from odom.frame import Camera, RgbdFrame

_SHORTEST_PERIOD_S = 1e-4
"""No camera is faster: closer stamps are microseconds, milliseconds or frame numbers."""
_MOST_TOO_CLOSE = 3
"""This many frames in a row may be closer, after a hiccup of the device's clock; further ones are refused."""


class FrameOrder:
    """Checks that one camera's frames come in time order; a leap back by more than a second begins a new time."""

    def __init__(self) -> None:
        self._too_close = 0

    def check(self, frame: RgbdFrame, camera: Camera, log: FrameLog) -> None:
        """Raise InputError for what is no frame, or one that cannot follow the last one of the log."""
        check_type("frame", frame, RgbdFrame, "odom.RgbdFrame(sequence, stamp, color, ...)")
        since_last_s = log.since_last_s(frame.stamp)
        if frame.depth_mm.shape != (camera.height, camera.width):
            raise InputError(f"a frame of {frame.depth_mm.shape[::-1]} pixels from {camera}: give that camera's own")
        if -TUNING.new_time_s <= since_last_s <= 0.0:
            raise InputError(f"frame {frame.sequence} is not later than the one before: give frames in order of time")
        self._too_close = self._too_close + 1 if 0.0 < since_last_s < _SHORTEST_PERIOD_S else 0
        if self._too_close > _MOST_TOO_CLOSE:
            raise InputError(
                f"frame {frame.sequence} is stamped {since_last_s:.1e} s after the one before: give stamps in "
                "nanoseconds; odom.from_seconds(...) makes them of seconds"
            )
