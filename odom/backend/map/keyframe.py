"""Key frames: where they are, and which landmarks they measured."""

import math
from dataclasses import dataclass, field

import numpy as np

from odom.backend.map.landmarks import Landmarks
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.features.lens_change import LensChange
from odom.frontend.features.measurement import Measurements
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled

_NO_ROWS, _NO_UV = np.zeros(0, dtype=np.int64), np.zeros((0, 2))
"""What a key frame without landmarks has; one array for all of them."""
_NOTHING_MEASURED = Measurements.nothing()
_UNKNOWN_TIMING = ShutterTiming()
UNKNOWN_TWIST = np.full(6, np.nan)
"""The `twist_around` of a frame around which too few others are known."""


@dataclass(frozen=True, eq=False)
class MeasuredLandmarks:
    """Landmarks, by their `rows` (n) in the map, that a frame has measured at `uv` (n x 2 px)."""

    rows: Index
    uv: Array
    measurements: Measurements

    @classmethod
    def nothing(cls) -> "MeasuredLandmarks":
        """Return the value for no landmark at all."""
        return cls(_NO_ROWS, _NO_UV, _NOTHING_MEASURED)


@dataclass(eq=False, kw_only=True)
class FrameObservations:
    """What a frame measured of landmarks, which `rows` and `identities` (n) name, computed with `timing`.

    `displaced` is what it measured of further landmarks, found near where its pose predicts them but not there (None:
    nothing). It is not used for the map, but it shows a poor lens: without it, calibration would find that lens again.
    `twist_around` (6, SI, camera frame) is the camera's velocity as the poses of the frames around show it, NaN where
    that is not known.
    """

    rows: Index
    identities: Index
    measurements: Measurements
    timing: ShutterTiming
    displaced: "FrameObservations | None" = None
    twist_around: Array = field(default_factory=lambda: UNKNOWN_TWIST)

    @classmethod
    def of(cls, measured: MeasuredLandmarks, landmarks: Landmarks, timing: ShutterTiming) -> "FrameObservations":
        """Return what a frame has `measured` of the `landmarks` of a map."""
        identities = landmarks.identity[measured.rows].copy()
        return FrameObservations(
            rows=measured.rows, identities=identities, measurements=measured.measurements, timing=timing
        )

    def change_lens(self, change: LensChange) -> None:
        """Convert what was measured to a new lens."""
        self.measurements = change.measured(self.measurements)
        if self.displaced is not None:
            self.displaced.change_lens(change)

    def current(self, landmarks: Landmarks) -> Mask:
        """Return which of the measured landmarks are still in the map (n); identity 0: culled before it was noted."""
        return np.asarray((landmarks.identity[self.rows] == self.identities) & (self.identities > 0))


@dataclass(eq=False, kw_only=True)
class Keyframe(FrameObservations):
    """A frame whose measurements are kept, at `uv` (n x 2 px); `T_camera_map` moves as the map is adjusted.

    The pose is that of its middle row, and `T_middle_stamp` the motion from there to its stamp. `first` is the key
    frame that its segment began with, `covariance_since_start` (6 x 6, `se3`, camera frame) that of the motion since.
    `session` counts the walks that made a saved map. It was the run's `frame` of that number; one of an earlier
    session was none (-1).
    """

    number: int
    frame: int
    stamp: Stamp
    segment: int
    first: int
    T_camera_map: Array
    uv: Array
    covariance_since_start: Array
    T_middle_stamp: Array = field(default_factory=lambda: np.eye(4))
    session: int = 0

    @classmethod
    def set_aside(
        cls, number: int, stamp: Stamp, segment: int, T_camera_map: Array, T_middle_stamp: Array
    ) -> "Keyframe":
        """Return a key frame of which nothing but its pose is in memory."""
        return cls(
            rows=_NO_ROWS,
            identities=_NO_ROWS,
            measurements=_NOTHING_MEASURED,
            timing=_UNKNOWN_TIMING,
            number=number,
            frame=-1,
            stamp=stamp,
            segment=segment,
            first=number,
            T_camera_map=T_camera_map,
            uv=_NO_UV,
            covariance_since_start=np.zeros((6, 6)),
            T_middle_stamp=T_middle_stamp,
        )

    def is_newer_than(self, age_s: float, stamp: Stamp) -> bool:
        """Return whether it was made in this run, less than `age_s` before `stamp`; one of a later stamp is older."""
        return self.frame >= 0 and 0.0 <= (stamp - self.stamp) * 1e-9 < age_s

    def forget(self) -> None:
        """Drop what was measured; the empty arrays that remain are shared by all forgotten key frames."""
        self.displaced = None
        self.rows = self.identities = _NO_ROWS
        self.uv, self.measurements = _NO_UV, _NOTHING_MEASURED


def pose_distances(T_camera_map: Array, others: Array) -> Array:
    """Return how far `others` (n x 4 x 4, T_camera_map too) are from a pose (n).

    Far is metres plus radians: at a metre's depth, both move a feature about as far.
    """
    return _pose_distances(
        np.array(T_camera_map), np.array(others)
    )  # copies: what a file's bytes hold is of another type


@compiled
def _pose_distances(T: Array, others: Array) -> Array:
    """Return the length of the translation plus the angle of the rotation of each motion `T inv(others[k])` (n)."""
    out = np.zeros(len(others))
    for k in range(len(others)):
        other, apart_m2, trace = others[k], 0.0, 0.0
        for i in range(3):
            away = T[i, 3]
            for j in range(3):
                turned = T[i, 0] * other[j, 0] + T[i, 1] * other[j, 1] + T[i, 2] * other[j, 2]
                away -= turned * other[j, 3]
                trace += T[i, j] * other[i, j]
            apart_m2 += away * away
        cosine = 0.5 * (trace - 1.0)
        out[k] = math.sqrt(apart_m2) + math.acos(min(max(cosine, -1.0), 1.0))
    return out
