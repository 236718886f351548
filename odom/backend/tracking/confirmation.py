"""A doubtful recognition in a saved map waits for a second frame that agrees: a wrong pose would be believed for long.

Within a run a wrong recognition is soon contradicted by what the camera just saw; in a map of another day nothing is
known beforehand, and rooms may look alike.
"""

from odom.backend.map.map import Map
from odom.backend.tracking.motion_model import is_plausible_motion, mean_twist
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.geometry.arrays import Array

_NEXT_PERIODS = 1.5
"""A frame within so many periods of the stream is the next one: its stamp jitters by half a period at most."""


class Confirmation:
    """Remembers the last doubtful recognition in `map_`."""

    def __init__(self, map_: Map) -> None:
        self._map = map_
        self._doubtful: tuple[SteadyStamp, int, Array] | None = None

    def confirmed(self, tracked: TrackedFrame | None, stamp: SteadyStamp, period_s: float) -> TrackedFrame | None:
        """Return a frame recognised at `stamp` if it is sure or agrees with the doubtful one before, None otherwise.

        `period_s` is the stream's: of a slow one, the frame right before counts.
        """
        before, self._doubtful = self._doubtful, None
        if tracked is None or not self._map.earlier_keyframes or _is_sure(tracked):
            return tracked
        segment = self._map.keyframes[tracked.reference].segment
        if before is not None:
            since_s = (stamp - before[0]) * 1e-9
            is_soon = 0.0 < since_s < max(TUNING.doubt_s, _NEXT_PERIODS * period_s) and segment == before[1]
            if is_soon and is_plausible_motion(mean_twist(before[2], tracked.T_camera_map, since_s)):
                return tracked
        self._doubtful = stamp, segment, tracked.T_map_camera
        return None


def _is_sure(tracked: TrackedFrame) -> bool:
    sure = max(2 * TUNING.found_again, TUNING.sure_share * len(tracked.looked_for))
    return tracked.found_again >= sure
