"""For how long the camera has been without depth, or without anything known in sight, while it was looking."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.frame import Stamp
from odom.frontend.depth import has_depth

_NEVER = Stamp(0)
_LEAST_DEEP, _LONGEST_SHALLOW_S = 0.05, 0.15
LEAP_S = 1.0
"""A frame so much later or earlier than the last one belongs to another time."""


@dataclass(frozen=True)
class Sight:
    """The last stamps with a depth image that shows anything, and with landmarks whose depth was measured.

    `astray_s` is how long it has been looking, with depth, without finding a known place.
    """

    depth_stamp: Stamp = _NEVER
    deep_stamp: Stamp = _NEVER
    astray_s: float = 0.0

    def after(self, stamp: Stamp, depth_mm: NDArray[np.uint16]) -> "Sight":
        """Return the sight after one more frame's depth image."""
        return replace(self, depth_stamp=stamp) if has_depth(depth_mm) else self

    def placed(self, stamp: Stamp, chi2_depth: NDArray[np.float64]) -> "Sight":
        """Return the sight after a frame that was placed by n landmarks, 0 where their depth was not measured."""
        is_deep = np.count_nonzero(chi2_depth) >= _LEAST_DEEP * len(chi2_depth)
        return replace(self, deep_stamp=stamp if is_deep else self.deep_stamp, astray_s=0.0)

    def begun(self, stamp: Stamp) -> "Sight":
        """Return the sight after a frame that began a segment."""
        return replace(self, deep_stamp=stamp, astray_s=0.0)

    def astray(self, since_last_s: float) -> "Sight":
        """Return the sight after a frame with depth that could not be placed."""
        return replace(self, astray_s=self.astray_s + since_last_s) if 0.0 < since_last_s < LEAP_S else self

    def is_blind(self, stamp: Stamp, longest_s: float) -> bool:
        """Say whether, at `stamp`, no depth image has shown anything for longer than `longest_s`."""
        return (stamp - self.depth_stamp) * 1e-9 > longest_s

    def is_shallow(self, stamp: Stamp) -> bool:
        """Say whether frames have been placed without landmarks' depth for too long to be sure of them at `stamp`."""
        return (stamp - self.deep_stamp) * 1e-9 > _LONGEST_SHALLOW_S
