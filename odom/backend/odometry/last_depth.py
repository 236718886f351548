"""When depth was last seen, and when it last helped to place a frame: how long the camera has been without."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.odometry.tuning import TUNING
from odom.frontend.camera.stamp_clock import SteadyStamp, is_within
from odom.geometry.arrays import Array


@dataclass(frozen=True)
class LastDepth:
    """The times of the last depth image that showed anything, and of the last frame placed by landmarks with depth.

    None: there was none yet.
    """

    shown_stamp: SteadyStamp | None = None
    placing_stamp: SteadyStamp | None = None

    def after_depth(self, stamp: SteadyStamp) -> "LastDepth":
        """Return what is known after one more frame whose depth image shows something."""
        return replace(self, shown_stamp=stamp)

    def after_tracked(self, stamp: SteadyStamp, chi2_depth: Array) -> "LastDepth":
        """Return what is known after a frame placed by n landmarks; `chi2_depth` (n) is 0 without measured depth."""
        is_deep = np.count_nonzero(chi2_depth) >= TUNING.least_deep * len(chi2_depth)
        return replace(self, placing_stamp=stamp) if is_deep else self

    def after_beginning(self, stamp: SteadyStamp) -> "LastDepth":
        """Return what is known after a frame that began a segment."""
        return replace(self, placing_stamp=stamp)

    def is_blind(self, stamp: SteadyStamp, bridge_s: float, period_s: float) -> bool:
        """Return whether, at `stamp`, no depth image has shown anything for longer than `bridge_s` or some periods."""
        return not is_within(max(bridge_s, TUNING.longest_blind_periods * period_s), self.shown_stamp, stamp)

    def is_shallow(self, stamp: SteadyStamp) -> bool:
        """Return whether, at `stamp`, frames have been placed without measured depth for too long to be sure."""
        return not is_within(TUNING.longest_shallow_s, self.placing_stamp, stamp)
