"""When a frame becomes a key frame, and what it adds to the map: too little is left of what the last one saw."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.keyframe import Keyframe, Measured
from odom.backend.map.map import Corners, Map
from odom.backend.mapping.standing import RecentViews
from odom.backend.mapping.tuning import TUNING
from odom.backend.settings import OdometrySettings
from odom.backend.tracking.frame_state import FrameState, Tracked
from odom.backend.tracking.motion_model import AT_REST
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.image_parts import parts_of
from odom.frontend.features.measurement import Measurements, measure
from odom.frontend.features.view import View
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.numbered import distinct

_CERTAIN = np.zeros((6, 6))
"""Covariance of a segment's first pose, which is certain by definition."""


@dataclass(frozen=True, eq=False)
class KeyframeView:
    """The view of key frame number `keyframe`, while it is worked on, and the `twist` (6, SI) it was measured with."""

    keyframe: int
    view: View
    twist: Array


@dataclass(frozen=True)
class Coverage:
    """What a frame sees: how many `landmarks`, and how many `cells` of the image they lie in."""

    landmarks: int
    cells: int

    @classmethod
    def of(cls, uv: Array) -> "Coverage":
        """Return the coverage by landmarks found at `uv` (n x 2 px)."""
        return cls(len(uv), len(distinct(parts_of(uv, TUNING.coverage_cell_px))))

    def is_worn(self, at_keyframe: "Coverage") -> bool:
        """Return whether too little is left of what was seen right after the last key frame."""
        wanted = min(TUNING.coverage_enough, TUNING.coverage_share_landmarks * at_keyframe.landmarks)
        is_worn_in_part = self.cells < TUNING.coverage_share_cells * at_keyframe.cells
        return self.landmarks < wanted or self.landmarks < TUNING.coverage_least or is_worn_in_part


class KeyframeInserter:
    """Inserts key frames into `map_`; `undescribed` are the newest ones whose places are not in the index yet.

    `recent` are the frames before, which tell what stands still.
    """

    def __init__(self, map_: Map, settings: OdometrySettings) -> None:
        self._map, self._settings = map_, settings
        self._newest: KeyframeView | None = None
        self._coverage_at_keyframe: Coverage | None = None
        self._is_worn_out = False
        self.undescribed: list[KeyframeView] = []
        self.recent = RecentViews(map_)
        self.moved_share = 0.0
        """In how much of the last key frame's view most corners had moved."""

    def first_corners(self, view: View, sensor: SensorModel) -> Corners | None:
        """Return a frame's corners with depth, as if at rest; None: too few for the next frame to be found by them."""
        corners = self._new_corners(view, np.zeros((0, 2)), AT_REST, sensor)
        return corners if len(corners.uv) >= TUNING.least_begun else None

    def begin_segment(self, view: View, corners: Corners, T_camera_map: Array, sensor: SensorModel) -> Keyframe:
        """Begin a segment with a frame and its `first_corners`; `remeasure` it once its motion is known."""
        self.recent.forget()
        nothing = Measured.nothing()
        keyframe = self._map.add_keyframe(view, T_camera_map, nothing, corners, sensor.timing, None, _CERTAIN)
        self._work_on(keyframe, view, AT_REST)
        self._newest = self._coverage_at_keyframe = None
        return keyframe

    def insert(self, view: View, tracked: Tracked, twist: Array, covariance: Array, sensor: SensorModel) -> Keyframe:
        """Make a key frame of a tracked frame with motion `twist` (6, SI) and `covariance` (6 x 6) of its pose."""
        T, seen, reference = tracked.T_camera_map, tracked.inlying, tracked.reference
        corners = self._new_corners(view, seen.uv, twist, sensor)
        stands, self.moved_share = self.recent.standing(view, tracked, corners, sensor)
        corners = corners.take(stands)
        keyframe = self._map.add_keyframe(view, T, seen, corners, sensor.timing, reference, covariance)
        self._work_on(keyframe, view, twist)
        self._newest, self._coverage_at_keyframe, self._is_worn_out = self.undescribed[-1], None, False
        return keyframe

    def kept(self, state: FrameState, sensor: SensorModel) -> FrameState:
        """Make the newest frame, that of `state`, a key frame after all unless it is one; return its state then."""
        tracked = state.tracked
        if tracked is None or self._map.keyframes[state.reference].stamp == state.view.stamp:
            return state
        inliers = tracked.inliers & self._map.landmarks.alive[tracked.rows]
        tracked = replace(tracked, T_camera_map=state.T_camera_map, inliers=inliers, reference=state.reference)
        covariance = tracked.covariance * sensor.noise.covariance_scale
        keyframe = self.insert(state.view, tracked, state.twist, covariance, sensor)
        keyframe.T_middle_stamp = _T_middle_stamp(state.view, state.twist, sensor)
        return replace(state, tracked=tracked, reference=keyframe.number, rows=keyframe.rows, uv=keyframe.uv)

    def is_due(self, tracked: Tracked) -> bool:
        """Return whether too little is left in a frame of what the last key frame saw, and the camera has moved."""
        coverage = Coverage.of(tracked.inlying.uv)
        self._coverage_at_keyframe = self._coverage_at_keyframe or coverage
        is_worn = self._is_worn_out or coverage.is_worn(self._coverage_at_keyframe)
        near = self._map.keyframes[tracked.reference]
        T_camera_keyframe = tracked.T_camera_map @ se3.inverse(near.T_camera_map)
        return is_worn and _has_moved(T_camera_keyframe)

    def wear_out(self) -> None:
        """Make a key frame as soon as the camera has moved, whatever is left of what the last one saw."""
        self._is_worn_out = True

    def forget_coverage(self) -> None:
        """Compare later frames with the next one: the camera is at another place than the last key frame's."""
        self._coverage_at_keyframe = None

    def remeasure_newest(self, twist: Array | None, sensor: SensorModel) -> None:
        """If the last frame became a key frame, measure it again: `twist` (6, SI) led from it to the next frame.

        None where the next frame did not follow from it: then it stays as it is.
        """
        if self._newest is not None and twist is not None:
            mean = 0.5 * (self._newest.twist + twist)
            self.remeasure(self._newest.keyframe, self._newest.view, mean, sensor)
        self._newest = None

    def remeasure_first(self, number: int, view: View, twist: Array, sensor: SensorModel) -> None:
        """Measure the key frame that began a segment again: `twist` (6, SI) led from it to the second frame.

        The same motion led from its middle row to its stamp.
        """
        self.remeasure(number, view, twist, sensor)
        self._map.keyframes[number].T_middle_stamp = _T_middle_stamp(view, twist, sensor)
        self._map.journal.move([number])

    def remeasure(self, number: int, view: View, twist: Array, sensor: SensorModel) -> None:
        """Measure the features of key frame `number` again, now that its motion `twist` (6, SI) is known better."""
        keyframe = self._map.keyframes[number]
        self._map.remeasure(keyframe, _measure_exactly(view, sensor, keyframe.uv, twist), sensor.timing)

    def _new_corners(self, view: View, uv_known: Array, twist: Array, sensor: SensorModel) -> Corners:
        """Return corners with depth away from the landmarks at `uv_known` (m x 2 px)."""
        uv = detect_corners(view.images.full, uv_known, self._settings.cell_px)
        uv = uv[view.stands(uv)]
        measured = _measure_exactly(view, sensor, uv, twist)
        return Corners(uv, measured).take(measured.values[:, 2] > 1.0 / TUNING.farthest_m)

    def _work_on(self, keyframe: Keyframe, view: View, twist: Array) -> None:
        near = self._map.neighbours(keyframe.number, keyframe.T_camera_map, self._settings.local_keyframes)
        self._map.cull(near)
        self.undescribed.append(KeyframeView(keyframe.number, view, twist))
        del self.undescribed[: -self._settings.background_delay_frames]


def _measure_exactly(view: View, sensor: SensorModel, uv: Array, twist: Array) -> Measurements:
    """Measure corners at `uv` (n x 2 px) whose positions define their patches, and so have no error of their own."""
    return measure(view, sensor, uv, np.zeros((len(uv), 3)), twist)


def _T_middle_stamp(view: View, twist: Array, sensor: SensorModel) -> Array:
    return se3.exp(twist * view.since_middle_s(sensor.timing))


def _has_moved(T_camera_keyframe: Array) -> bool:
    """Return whether a camera is far enough from a key frame for another one: none is added at rest."""
    away = se3.log(T_camera_keyframe)
    return bool(np.linalg.norm(away[:3]) > TUNING.moved_m or np.linalg.norm(away[3:]) > TUNING.moved_rad)
