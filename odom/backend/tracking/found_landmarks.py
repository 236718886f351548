"""The landmarks found in a view, and the pose and velocity fitted to those of them that stand still."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.landmarks import Landmarks
from odom.backend.tracking.consensus import consensus
from odom.backend.tracking.departing import departing
from odom.backend.tracking.expected_pose import ExpectedPose, MotionPrior
from odom.backend.tracking.motion_model import ProcessNoise, Velocity
from odom.backend.tracking.pose_solver import PoseFit, chi2_of, fit_pose
from odom.backend.tracking.row_velocity import fit_velocity
from odom.backend.tracking.tuning import TUNING
from odom.backend.tracking.voting_features import VotingFeatures
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.measurement import Measurements, measure
from odom.frontend.features.view import View
from odom.frontend.matching.landmark_search import LandmarkMatches
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask

_WHITE_ACCELERATION = ProcessNoise(steady_s=0.0)


@dataclass(frozen=True, eq=False)
class FoundLandmarks:
    """n landmarks at `points` (n x 3, m, map frame) with `covariances` (n x 3 x 3, m^2), `found` in a `view`.

    `seen` (n) counts the frames in which each was found before, `found_before` (n) is their share of those in which it
    was looked for. The pose is fitted to those that `counts` (n) marks: not to departing ones, nor to any of vague
    depth where others are enough.
    """

    view: View
    sensor: SensorModel
    found: LandmarkMatches
    points: Array
    covariances: Array
    seen: Index
    found_before: Array
    counts: Mask

    @classmethod
    def of(cls, view: View, sensor: SensorModel, found: LandmarkMatches, landmarks: Landmarks) -> "FoundLandmarks":
        """Return the landmarks that were `found` in a view; those of vague depth count only where others are few."""
        rows = found.rows
        seen = landmarks.seen.take(rows)
        found_before = np.minimum((seen + 1.0) / (landmarks.tried.take(rows) + 1.0), 1.0)
        position, covariance = landmarks.position.take(rows, 0), landmarks.covariance.take(rows, 0)
        assumed = landmarks.assumed.take(rows)
        if assumed.any():
            covariance[assumed] = _counted_as_one(covariance[assumed])
        counts = those_that_count(landmarks.is_vague(rows))
        return cls(view, sensor, found, position, covariance, seen, found_before, counts)

    def measured(self, twist: Array) -> Measurements:
        """Return their measurements in a view taken in motion with `twist` (6, SI)."""
        covariance_uv = self.found.covariance_uv * TUNING.image_noise**2
        return measure(self.view, self.sensor, self.found.uv, covariance_uv, twist, self.found.inverse_depth)

    def fit(self, measured: Measurements, T_start: Array) -> PoseFit:
        """Return the pose fitted to those that count as `measured`, from the start `T_start`, and chi2 of all at it."""
        values, variances = self._straight(measured).values, measured.covariance
        fit = fit_pose(self.points, self.covariances, values, variances, T_start, self.counts)
        return fit if self.counts.all() else replace(fit, chi2=self._chi2(measured, fit.T_camera_map))

    def features(self, measured: Measurements, fit: PoseFit) -> VotingFeatures:
        """Return them as features that vote for a pose, as `measured` and seen from where a `fit` puts the camera."""
        eye, pixel = se3.inverse(fit.T_camera_map)[:3, 3], 1.0 / self.sensor.lens.intrinsics[0]
        rays, uv, sigma_px = measured.values[:, :2], self.found.uv, TUNING.found_sigma_px
        return VotingFeatures(self.points, eye, rays, uv, self.seen, sigma_px, pixel)

    def settled(
        self, measured: Measurements, fit: PoseFit, features: VotingFeatures, expected: ExpectedPose
    ) -> tuple["FoundLandmarks", Measurements, Array]:
        """Return those that count where many disagree with a `fit`, as measured, and the pose that most agree with.

        They vote for it as `features`.
        """
        eye = features.eye
        T = consensus(features, fit.T_camera_map, expected)
        T = fit.T_camera_map if T is None else T
        chi2 = self._chi2(measured, T)[:, 0]
        counts = self.counts & ~departing(self.points, eye, self.found_before, chi2 < TUNING.inlier_chi2)
        members = chi2 < TUNING.member_chi2
        if np.count_nonzero(members & counts) < TUNING.sure_inliers:
            counts = self.counts
        return self._take(members, counts), measured.take(members), T

    def velocity(self, measured: Measurements, T_camera_map: Array, twist: Array, prior: MotionPrior) -> Velocity:
        """Return the velocity that the image's rows show; they were measured in motion with `twist` (6, SI)."""
        if not self.counts.all():
            counting = self._take(self.counts, self.counts)
            return counting.velocity(measured.take(self.counts), T_camera_map, twist, prior)
        row_s = (self.found.uv[:, 1] / self.view.images.full.shape[0] - 0.5) * self.sensor.timing.readout_s
        expected = prior.motion.after(prior.since_s, _WHITE_ACCELERATION)
        seen = self._straight(measured)
        return fit_velocity(self.points, self.covariances, seen, row_s, T_camera_map, twist, expected, prior.scale)

    def _straight(self, measured: Measurements) -> Measurements:
        """Return what was measured, with the tilt of depth against the colour camera's axis taken out."""
        return measured.straight(self.sensor.depth_tilt.angles)

    def _chi2(self, measured: Measurements, T_camera_map: Array) -> Array:
        """Return chi2 (n x 2: ray, depth) of all at a pose."""
        values, variances = self._straight(measured).values, measured.covariance
        return chi2_of(self.points, self.covariances, values, variances, T_camera_map)

    def _take(self, members: Mask, counts: Mask) -> "FoundLandmarks":
        rows = np.flatnonzero(members)
        return replace(
            self,
            found=self.found.take(rows),
            points=self.points.take(rows, 0),
            covariances=self.covariances.take(rows, 0),
            seen=self.seen.take(rows),
            found_before=self.found_before.take(rows),
            counts=counts.take(rows),
        )


def those_that_count(vague: Mask) -> Mask:
    """Return which of n landmarks a pose is fitted to: where enough have a known depth, not the `vague` ones (n).

    What has no depth may be a body before the camera as well as a far wall.
    """
    return ~vague if np.count_nonzero(~vague) >= TUNING.known_enough else np.ones(len(vague), dtype=np.bool_)


def _counted_as_one(covariances: Array) -> Array:
    """Return covariances (n x 3 x 3, m^2) of landmarks of assumed depth with n times the variance along their rays.

    They err alike, all too near or all too far, also once parallax has told their depths: the steps of the camera by
    which it did were known by the same landmarks. As independent ones, many would make a sure but wrong step. Along
    the ray lies nearly all of the variance: C C / tr(C) is that share of it.
    """
    trace = np.trace(covariances, axis1=1, axis2=2)[:, None, None]
    return np.asarray(covariances + (len(covariances) - 1) * (covariances @ covariances) / trace)
