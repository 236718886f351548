"""A camera that could not be tracked: it is looked for at known places, and after a while a segment begins instead.

Where colour shows nothing to track it by, it is followed by surfaces meanwhile.
"""

import numpy as np

from odom.backend.map.corners import Corners
from odom.backend.map.frame_log import FrameLog
from odom.backend.map.map import Map
from odom.backend.mapping.keyframe_inserter import KeyframeInserter
from odom.backend.mapping.tuning import TUNING as MAPPING
from odom.backend.mapping.wide_step import follow_wide_step
from odom.backend.odometry.lost_views import LostViews
from odom.backend.odometry.next_frame import is_next
from odom.backend.odometry.surface_following import SurfaceFollowing, distribute_drift
from odom.backend.odometry.tuning import TUNING
from odom.backend.settings import OdometrySettings
from odom.backend.tracking.confirmation import Confirmation
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.relocalisation import relocalise
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.place_descriptor import Place
from odom.frontend.features.view import View


class LostCamera:
    """Looks for the camera in `map_`, and remembers the newest views in which it was not found, and where surfaces led.

    Where they had led is moved in the `log` once the camera is found.
    """

    def __init__(
        self, map_: Map, log: FrameLog, tracker: FrameTracker, inserter: KeyframeInserter, settings: OdometrySettings
    ) -> None:
        self._map, self._log, self._tracker, self._inserter, self._settings = map_, log, tracker, inserter, settings
        self._views = LostViews()
        self._confirmation = Confirmation(map_)
        self._following: SurfaceFollowing | None = None
        self._searched_s = 0.0

    def find(
        self, last: PosedFrame | None, view: View, place: Place, sensor: SensorModel, in_doubt: bool
    ) -> tuple[PosedFrame | None, TrackedFrame | None, bool]:
        """Track a view by the `place` it shows: near the newest frame, `last`, or else at any known place.

        Returns the newest frame afterwards; the tracked view, None where the camera is not found; and whether it was
        found near it.
        """
        placed = last
        last, tracked = follow_wide_step(self._tracker, self._inserter, last, view, place, sensor, in_doubt)
        is_near = tracked is not None
        if tracked is None:
            tracked = relocalise(self._map, self._tracker, last, view, place, sensor)
            tracked = self._confirmation.confirmed(tracked, view.steady_stamp, sensor.clock.period_s)
        following = self._leading_to(view, sensor)
        if tracked is not None and following is not None and placed is not None:
            distribute_drift(self._log, self._map, following, placed, view, tracked)
        return last, tracked, is_near

    def follow_surfaces(self, view: View, placed: PosedFrame | None, sensor: SensorModel) -> SurfaceFollowing | None:
        """Return where surfaces have led the camera by `view`; None where they don't.

        They lead on from the last frame where they led to that, or else from the one that landmarks `placed`, if it is
        given.
        """
        following = self._leading_to(view, sensor)
        if following is None and placed is not None:
            following = SurfaceFollowing.begun(placed, sensor, self._log.count)
        self._following = None if following is None else following.after(view, sensor, self._settings.bridge_s)
        return self._following

    def _leading_to(self, view: View, sensor: SensorModel) -> SurfaceFollowing | None:
        """Return where surfaces have led to the last frame, None unless they did and `view` follows that soon."""
        following, last = self._following, self._log.last
        if following is None or last is None or following.stamp != last.stamp:
            return None
        return following if is_next(following.since_s(view), sensor.clock.period_s) else None

    def sees_enough(self, view: View, place: Place, sensor: SensorModel) -> bool:
        """Return whether a view shows enough for a segment to begin: many features with depth, or many corners.

        As `place`, those with depth were described. Of the corners, so many must have depth as make a pose sure.
        """
        if len(place.points) >= TUNING.least_corners:
            return True
        corners = self._inserter.first_corners(view, sensor)
        if corners is None or len(corners.uv) < MAPPING.corners_enough:
            return False
        return bool(np.count_nonzero(corners.has_depth) >= TRACKING.sure_inliers)

    def first_corners(self, last: PosedFrame | None, view: View, sensor: SensorModel, in_doubt: bool) -> Corners | None:
        """Return the corners by which a segment may begin at a view in which the camera was not found; None: not yet.

        Known places are looked for during some time first, except where none can be recognised, since there is no
        frame, or one key frame from which none was tracked.
        """
        self._searched_s = searched_s(self._searched_s, self._log.since_last_s(view.stamp))
        self._views = self._views.after(view, sensor, in_doubt)
        is_unproven = (
            len(self._map.keyframes) - self._map.earlier_keyframes == 1 and last is not None and last.tracked is None
        )
        is_time = self._searched_s > self._views.patience * self._settings.new_segment_s
        if self._map.is_fixed or not (last is None or is_unproven or is_time):
            return None
        return self._inserter.first_corners(view, sensor, self._views.scene)

    def end_search(self) -> None:
        """Note that the camera has a pose again: the next search begins anew."""
        self._searched_s = 0.0


def searched_s(before_s: float, since_last_s: float) -> float:
    """Return for how long known places have been looked for, `since_last_s` after a frame by which it was `before_s`.

    A long pause counts as `new_time_s` of search at most, and a step back in time not at all.
    """
    return before_s + min(max(since_last_s, 0.0), TUNING.new_time_s)
