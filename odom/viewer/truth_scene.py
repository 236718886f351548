"""Draws truth: each body's trajectory in the map, and the errors of the poses against it."""

from collections.abc import Iterator

from odom.evaluation import Trajectory
from odom.evaluation.run_report import CAMERA
from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.viewer.bounded_trajectory import BoundedTrajectory
from odom.viewer.claimed_covariances import ClaimedCovariances
from odom.viewer.entities import EntityUpdate
from odom.viewer.line_strips import truth_line
from odom.viewer.truth_alignment import Comparison, PoseError, ProgressiveCalibration, TruthInMap, align_truth, in_map
from odom.wire.codec import StampedPose

_BODIES = 8
"""Bodies whose truth is drawn, the first heard of: each takes 2 MB."""


class TruthScene:
    """The trajectories of the bodies, at most `limit` poses each. The first body heard of is that of the camera.

    `fit` is how truth lies in the map, None while too little is known.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self.trajectories: dict[str, BoundedTrajectory] = {}
        self.fit: TruthInMap | None = None
        self._comparison = Comparison()
        self._calibration = ProgressiveCalibration()
        self._since = Stamp(0)

    def trajectory_of(self, body: str) -> BoundedTrajectory | None:
        """Return the trajectory of a body, None for one body too many."""
        if body not in self.trajectories and len(self.trajectories) < _BODIES:
            self.trajectories[body] = BoundedTrajectory(self._limit)
        return self.trajectories.get(body)

    def add(self, body: str, pose: StampedPose) -> None:
        """Take a true pose of a body."""
        kept = self.trajectory_of(body)
        if kept is None:
            return
        kept.add(pose.stamp, pose.T_parent_child)
        if body == next(iter(self.trajectories)):
            self._comparison.add_truth(pose.stamp, pose.T_parent_child)

    def compare(self, stamp: Stamp, T_map_camera: Array, covariance: Array | None) -> None:
        """Take a published pose, to be compared when truth has come for it."""
        self._comparison.add(stamp, T_map_camera, covariance)

    def begin_segment(self, stamp: Stamp) -> None:
        """Forget the alignment, and poses that wait to be judged by it: those from `stamp` on are in another world."""
        self.fit, self._since = None, stamp
        self._comparison.forget_before(stamp)

    def align(self, corrected: Trajectory, claimed: ClaimedCovariances, calibrates: bool) -> TruthInMap | None:
        """Align truth with the trajectory in the map and return how; None while too little is known."""
        if not self.trajectories:
            return None
        joined = corrected.segment == 0 if corrected.segment is not None else True
        estimate = corrected.take((corrected.stamps >= self._since) & joined)
        truth, markers = next(iter(self.trajectories.values())).trajectory(), not self._is_camera
        if calibrates and markers:
            self._calibration.update(estimate, truth)
        fit = align_truth(estimate, claimed, truth, self._calibration.found, markers)
        self.fit = fit or self.fit
        return fit

    def lines(self, stamp: Stamp) -> Iterator[EntityUpdate]:
        """Yield the trajectories of all bodies, once they are aligned."""
        if self.fit is None:
            return
        for body, kept in self.trajectories.items():
            yield truth_line(body, stamp, in_map(kept.trajectory(), self.fit).positions, kept.strips())

    def errors(self) -> Iterator[PoseError]:
        """Yield the errors of poses that truth has come for; with a marker body only once it is calibrated."""
        if self.fit is not None and (self.fit.calibrated is not None or self._is_camera):
            yield from self._comparison.errors(self.fit)

    @property
    def _is_camera(self) -> bool:
        """Whether the first body's truth is the camera's own; other bodies carry markers."""
        return next(iter(self.trajectories), "") == CAMERA
