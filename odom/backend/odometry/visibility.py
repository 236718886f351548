"""How long the camera has been without depth, or has looked around without finding a known place."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.odometry.tuning import TUNING
from odom.frame import Stamp
from odom.geometry.arrays import Array

_NEVER = Stamp(0)


@dataclass(frozen=True)
class Visibility:
    """The stamps of the last depth image that showed anything, and of the last frame placed by landmarks with depth.

    `searching_s` is how long the camera has been looking, with depth, without finding a known place.
    """

    depth_stamp: Stamp = _NEVER
    landmark_depth_stamp: Stamp = _NEVER
    searching_s: float = 0.0

    def with_depth(self, stamp: Stamp) -> "Visibility":
        """Return the visibility after one more frame whose depth image shows something."""
        return replace(self, depth_stamp=stamp)

    def with_tracked(self, stamp: Stamp, chi2_depth: Array) -> "Visibility":
        """Return the visibility after a frame placed by n landmarks; `chi2_depth` (n) is 0 without measured depth."""
        is_deep = np.count_nonzero(chi2_depth) >= TUNING.least_deep * len(chi2_depth)
        last = stamp if is_deep else self.landmark_depth_stamp
        return replace(self, landmark_depth_stamp=last, searching_s=0.0)

    def with_new_segment(self, stamp: Stamp) -> "Visibility":
        """Return the visibility after a frame that began a segment."""
        return replace(self, landmark_depth_stamp=stamp, searching_s=0.0)

    def with_search(self, since_last_s: float) -> "Visibility":
        """Return the visibility after a frame with depth that could not be placed, `since_last_s` after the last one.

        A long pause counts as `new_time_s` of search at most, and a step back in time not at all.
        """
        return replace(self, searching_s=self.searching_s + min(max(since_last_s, 0.0), TUNING.new_time_s))

    def is_blind(self, stamp: Stamp, bridge_s: float, period_s: float) -> bool:
        """Return whether, at `stamp`, no depth image has shown anything for longer than `bridge_s` or some periods."""
        return abs(stamp - self.depth_stamp) * 1e-9 > max(bridge_s, TUNING.longest_blind_periods * period_s)

    def lacks_depth(self, stamp: Stamp) -> bool:
        """Return whether, at `stamp`, frames have been placed without measured depth for too long to be sure."""
        return abs(stamp - self.landmark_depth_stamp) * 1e-9 > TUNING.longest_shallow_s
