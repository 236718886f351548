"""A frame tracked against the map: its pose, and the landmarks that it showed or should have shown."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.tracking.motion_model import ANY_VELOCITY, Velocity
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.measurement import Measurements
from odom.frontend.matching.line_of_sight import LineOfSight
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """A frame's pose `T_camera_map` for its middle row, with the information of the fit (6 x 6, camera frame).

    `rows` (n) are the landmarks found, at `uv` (n x 2 px), with their `measurements`, `chi2` (n x 2: ray, depth) and
    `inliers` (n); `looked_for` are the rows of all that were, `missed` those of them that are no inliers, with the line
    of `sight` to each; those found `elsewhere` seem to have moved. `reference` is the key frame nearest in
    pose, `twist` (6, SI, camera frame) the velocity that the measurements were carried with; where the rows of the
    image showed it, `twist_covariance` (6 x 6) is its covariance, else None. `disputed_since`: from when on many
    features have disagreed with the pose in every frame, None where few do.
    """

    T_camera_map: Array
    information: Array
    rows: Index
    uv: Array
    measurements: Measurements
    chi2: Array
    inliers: Mask
    looked_for: Index
    missed: Index
    elsewhere: Index
    sight: LineOfSight
    reference: int
    twist: Array
    twist_covariance: Array | None
    disputed_since: SteadyStamp | None = None

    @property
    def velocity(self) -> Velocity:
        """The velocity that the rows of the image showed; any, where they showed none."""
        return ANY_VELOCITY if self.twist_covariance is None else Velocity(self.twist, self.twist_covariance)

    @cached_property
    def T_map_camera(self) -> Array:
        """The pose the other way round."""
        return se3.inverse(self.T_camera_map)

    @cached_property
    def inlier_landmarks(self) -> MeasuredLandmarks:
        """The landmarks found where the pose predicts them."""
        return self._measured(self.inliers)

    @property
    def is_contested(self) -> bool:
        """Whether so many landmarks seem to have moved that they may be the scene's."""
        return len(self.elsewhere) >= max(TUNING.contested_least, TUNING.contested_share * self.inlier_count)

    @property
    def displaced(self) -> MeasuredLandmarks:
        """The landmarks found near where the pose predicts them, but not there."""
        return self._measured(~self.inliers & (self.chi2[:, 0] < TUNING.displaced_chi2))

    def _measured(self, chosen: Mask) -> MeasuredLandmarks:
        rows = np.flatnonzero(chosen)
        return MeasuredLandmarks(self.rows.take(rows), self.uv.take(rows, 0), self.measurements.take(rows))

    @cached_property
    def inlier_count(self) -> int:
        """How many landmarks were found where the pose predicts them."""
        return int(np.count_nonzero(self.inliers))

    @property
    def found_again(self) -> int:
        """How many landmarks were found where the pose predicts them, at the predicted depth where it was measured."""
        return int(np.count_nonzero(self.inliers & (self.chi2[:, 1] < TUNING.inlier_chi2)))

    @property
    def visible_count(self) -> int:
        """How many landmarks were looked for, without those hidden by something nearer: half of them at most."""
        return len(self.looked_for) - min(int(np.count_nonzero(self.sight.hidden)), len(self.looked_for) // 2)

    @cached_property
    def covariance(self) -> Array:
        """The pose's 6 x 6 covariance (`se3`, camera frame) that follows from those of the measurements."""
        return np.asarray(np.linalg.inv(self.information), dtype=np.float64)
