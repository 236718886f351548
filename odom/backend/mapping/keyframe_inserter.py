"""When a frame becomes a key frame (too little is left of what the last one saw), and what it adds to the map."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.corners import Corners
from odom.backend.map.keyframe import FrameObservations, Keyframe, MeasuredLandmarks
from odom.backend.map.map import Map
from odom.backend.mapping.coverage import Coverage
from odom.backend.mapping.new_corners import CornerSearch, FoundCorners, NewCorners
from odom.backend.mapping.presence import retire
from odom.backend.mapping.standing import RecentViews, standing_since
from odom.backend.mapping.tuning import TUNING
from odom.backend.settings import OdometrySettings
from odom.backend.tracking.motion_model import AT_REST
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.lens_change import LensChange
from odom.frontend.features.measurement import measure_exactly
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import EarlierView
from odom.geometry import se3
from odom.geometry.arrays import Array

_CERTAIN = np.zeros((6, 6))
"""Covariance of a segment's first pose, which is certain by definition."""


@dataclass(frozen=True, eq=False)
class KeyframeView:
    """The view of key frame number `keyframe`, while it is worked on, and the `twist` (6, SI) it was measured with.

    Where moving bodies leave its pose in doubt, the place that it shows is only what lies around the `standing` points
    of the image (n x 2 px); None: all of it.
    """

    keyframe: int
    view: View
    twist: Array
    standing: Array | None = None


class KeyframeInserter:
    """Inserts key frames into `map_`; `undescribed` are the newest ones whose places are not in the index yet.

    `recent` are the frames before, which tell what stands still. The new corners of a key frame are looked for in the
    background; a quick stream goes on meanwhile with the landmarks that are known (see `NewCorners`). In doubt, the
    place that it shows is described only then, when it is known what stands in it.
    """

    def __init__(self, map_: Map, settings: OdometrySettings) -> None:
        self._map, self._settings = map_, settings
        self._newest: KeyframeView | None = None
        self._coverage_at_keyframe: Coverage | None = None
        self._is_wanted = False
        self.undescribed: list[KeyframeView] = []
        self.recent = RecentViews(map_)
        self._new_corners = NewCorners(settings)

    def first_corners(self, view: View, sensor: SensorModel, scene: EarlierView | None = None) -> Corners | None:
        """Return a frame's corners, measured as if at rest; None: too few with depth to find the next frame by them.

        Where an earlier view shows the `scene`, only those that stand in it.
        """
        corners = self._new_corners.first(view, np.zeros((0, 2)), AT_REST, sensor)
        if scene is not None:
            deep = corners.take(corners.has_depth)
            corners = deep.take(standing_since(view, deep, scene, sensor))
        return corners if np.count_nonzero(corners.has_depth) >= TUNING.least_begun else None

    def is_bare(self, view: View, sensor: SensorModel) -> bool:
        """Return whether a view has too few corners for anything to be found by them."""
        return self.first_corners(view, sensor) is None

    def begin(
        self,
        view: View,
        corners: Corners,
        T_camera_map: Array,
        sensor: SensorModel,
        in_doubt: bool,
        against: tuple[int, Array] | None = None,
    ) -> Keyframe:
        """Begin a segment with a frame and its `first_corners`; `remeasure` it once its motion is known.

        `in_doubt`: most of the view moves. Where the pose is known `against` the key frame of that number, with a
        covariance (6 x 6), its segment goes on instead.
        """
        self.insert_found_corners(None, sensor)
        self.recent.forget()
        corners = corners.take(corners.has_depth) if in_doubt else corners
        nothing, (reference, covariance) = MeasuredLandmarks.nothing(), against or (None, _CERTAIN)
        keyframe = self._map.add_keyframe(view, T_camera_map, nothing, sensor.timing, reference, covariance)
        self._map.add_corners(keyframe, view, corners, sensor.depth_tilt.angles)
        self._queue_for_description(KeyframeView(keyframe.number, view, AT_REST, corners.uv if in_doubt else None))
        self._newest = self._coverage_at_keyframe = None
        return keyframe

    def insert(
        self,
        view: View,
        tracked: TrackedFrame,
        twist: Array,
        covariance: Array,
        sensor: SensorModel,
        count: int,
        in_doubt: bool,
    ) -> Keyframe:
        """Make a key frame of the tracked frame number `count`; begin to look for its new corners.

        Its motion is `twist` (6, SI), its pose has the `covariance` (6 x 6), and moving bodies leave that `in_doubt`.
        """
        T, seen, reference = tracked.T_camera_map, tracked.inlier_landmarks, tracked.reference
        keyframe = self._map.add_keyframe(view, T, seen, sensor.timing, reference, covariance)
        keyframe.displaced = FrameObservations.of(tracked.displaced, self._map.landmarks, sensor.timing)
        self._newest = KeyframeView(keyframe.number, view, twist)
        self._coverage_at_keyframe, self._is_wanted = None, False
        if not in_doubt:
            self._queue_for_description(self._newest)
        compared = self.recent.compared_with(view, tracked)
        self._new_corners.look_for(CornerSearch(keyframe.number, compared, twist, sensor, in_doubt), count)
        return keyframe

    def insert_found_corners(self, count: int | None, sensor: SensorModel) -> FoundCorners | None:
        """Make landmarks of a key frame's new corners if the frame after number `count` needs them (None: at once).

        Returns them; None where nothing was due.
        """
        found = self._new_corners.take(count, sensor)
        if found is not None:
            search = found.search
            keyframe, view = self._map.keyframes[search.keyframe], search.compared.view
            self._map.add_corners(keyframe, view, found.corners, sensor.depth_tilt.angles)
            self._map.cull(self._map.neighbours(keyframe.number, keyframe.T_camera_map, self._settings.local_keyframes))
            if search.in_doubt:
                self._queue_for_description(KeyframeView(keyframe.number, view, search.twist, keyframe.uv))
        return found

    def ensure_keyframe(self, last: PosedFrame, sensor: SensorModel, in_doubt: bool) -> PosedFrame:
        """Make the newest frame, `last`, a key frame after all unless it is one; return it as it is then.

        Not where its pose is `in_doubt` and it shows too little that has been known for a while.
        """
        self.insert_found_corners(None, sensor)
        tracked, keyframe = last.tracked, self._map.keyframes[last.reference]
        if tracked is None or (in_doubt and not self._is_long_known(last.view, tracked)):
            return last
        if keyframe.frame != last.view.number:
            inliers = tracked.inliers & self._map.landmarks.alive[tracked.rows]
            tracked = replace(tracked, inliers=inliers, reference=last.reference)
            covariance = tracked.covariance * sensor.noise.covariance_scale
            keyframe = self.insert(last.view, tracked, last.twist, covariance, sensor, 0, in_doubt)
            keyframe.T_middle_stamp = _T_middle_stamp(last.view, last.twist, sensor)
            self.insert_found_corners(None, sensor)
        return replace(last, tracked=tracked, reference=keyframe.number, rows=keyframe.rows, uv=keyframe.uv)

    def drop(self, tracked: TrackedFrame, since: int, sensor: SensorModel) -> None:
        """Retire landmarks on the body that a frame was tracked by, and forget the recent frames: they show it."""
        self._new_corners.take(None, sensor)
        retire(self._map, tracked, since)
        self.recent.forget()

    def is_due(self, view: View, tracked: TrackedFrame, in_doubt: bool) -> bool:
        """Return whether too little is left in a view of what the last key frame saw, and the camera has moved.

        A segment's only key frame is followed by another after a while in any case: nothing is adjusted until then.
        Where moving bodies leave its pose `in_doubt`, the view must show enough that has been known for a while.
        """
        if self._new_corners.are_coming or (in_doubt and not self._is_long_known(view, tracked)):
            return False
        coverage = Coverage.of(tracked.inlier_landmarks.uv)
        self._coverage_at_keyframe = self._coverage_at_keyframe or coverage
        is_worn = self._is_wanted or coverage.is_worn(self._coverage_at_keyframe)
        near = self._map.keyframes[tracked.reference]
        is_alone = near.number == near.first == len(self._map.keyframes) - 1
        is_due = is_worn or (is_alone and not near.is_newer_than(TUNING.alone_s, view.stamp))
        T_camera_keyframe = tracked.T_camera_map @ se3.inverse(near.T_camera_map)
        return is_due and _has_moved(T_camera_keyframe)

    def _is_long_known(self, view: View, tracked: TrackedFrame) -> bool:
        """Return whether enough landmarks agree that were made a while ago, or the segment is too young to have any.

        A body that comes to be followed is all new: its first landmarks would agree with the next ones on it.
        """
        keyframes = self._map.keyframes
        if keyframes[keyframes[tracked.reference].first].is_newer_than(TUNING.young_segment_s, view.stamp):
            return True
        number, count = np.unique(self._map.landmarks.keyframe[tracked.inlier_landmarks.rows], return_counts=True)
        is_old = [not keyframes[n].is_newer_than(TUNING.long_known_s, view.stamp) for n in number.tolist()]
        return int(count[is_old].sum()) >= TUNING.long_known_least

    def want_keyframe(self) -> None:
        """Make a key frame as soon as the camera has moved, whatever is left of what the last one saw."""
        self._is_wanted = True

    def take_undescribed(self) -> list[KeyframeView]:
        """Hand over the key frames whose places are to be described."""
        taken, self.undescribed = self.undescribed, []
        return taken

    def compare_with(self, number: int) -> None:
        """Compare later frames with what key frame `number` saw: the camera is there again, not where it was before."""
        self._coverage_at_keyframe = Coverage.of(self._map.keyframes[number].uv)

    def remeasure_newest(self, twist: Array | None, sensor: SensorModel) -> None:
        """If the last frame became a key frame, measure it again: `twist` (6, SI) led from it to the next frame.

        None where the next frame did not follow from it, or came late: then it stays as it is.
        """
        if self._newest is not None and twist is not None:
            mean = 0.5 * (self._newest.twist + twist)
            self.remeasure(self._newest.keyframe, self._newest.view, mean, sensor)
            self._new_corners.remeasure(mean, sensor)
        self._newest = None

    def change_lens(self, change: LensChange) -> None:
        """Use a new lens to measure corners that are still looked for."""
        self._new_corners.change_lens(change)

    def remeasure_first(self, number: int, view: View, twist: Array, sensor: SensorModel) -> None:
        """Measure the key frame that began a segment again: `twist` (6, SI) led from it to the second frame.

        The same motion led from its middle row to its stamp.
        """
        self.remeasure(number, view, twist, sensor)
        self._map.keyframes[number].T_middle_stamp = _T_middle_stamp(view, twist, sensor)
        self._map.journal.note_new_or_moved([number])

    def remeasure(self, number: int, view: View, twist: Array, sensor: SensorModel) -> None:
        """Measure the features of key frame `number` again, now that its motion `twist` (6, SI) is known better."""
        keyframe = self._map.keyframes[number]
        measured = measure_exactly(view, sensor, keyframe.uv, twist)
        self._map.remeasure(keyframe, measured, sensor.timing, sensor.depth_tilt.angles)

    def _queue_for_description(self, seen: KeyframeView) -> None:
        self.undescribed.append(seen)
        del self.undescribed[: -self._settings.background_delay_frames]


def _T_middle_stamp(view: View, twist: Array, sensor: SensorModel) -> Array:
    return se3.exp(twist * view.since_middle_s(sensor.timing))


def _has_moved(T_camera_keyframe: Array) -> bool:
    """Return whether a camera is far enough from a key frame for another one: none is added at rest."""
    away = se3.log(T_camera_keyframe)
    return bool(np.linalg.norm(away[:3]) > TUNING.moved_m or np.linalg.norm(away[3:]) > TUNING.moved_rad)
