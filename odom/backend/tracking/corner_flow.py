"""Corners of one view followed into another: those with depth can tell motions apart, those without can deny one."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from odom.backend.tracking.consensus import FollowedFeatures
from odom.backend.tracking.pose_solver import PoseFit, fit_pose
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.measurement import Measurements, measure, measure_exactly, points_of
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import EarlierView
from odom.frontend.matching.optical_flow import follow_there_and_back
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask

_FAR_M = 1e3
"""A corner without depth is looked for where it would be this far away."""
_LEAST_DEPTH = 0.1
"""A corner is projected as if the camera came no nearer to it than this share of the least distance that counts."""


@dataclass(frozen=True, eq=False)
class DepthlessCorners:
    """m corners without depth: `rays` (m x 2) in the earlier camera's frame, `followed` (m x 2) in the later one's."""

    rays: Array
    followed: Array

    def off_line(self, T_view_earlier: Array) -> Array:
        """Return how far each is from where it can be if it stood still, however far away it is (m, rays' unit).

        That is a part of its epipolar line: from its place at infinity to the one at the least distance that counts
        (R. Hartley, A. Zisserman, Multiple View Geometry, 2004, chapter 9).
        """
        at_infinity = np.column_stack([self.rays, np.ones(len(self.rays))]) @ T_view_earlier[:3, :3].T
        near = at_infinity + T_view_earlier[:3, 3] / TUNING.depthless_nearest_m
        begin, end = (each[:, :2] / np.maximum(each[:, 2:], _LEAST_DEPTH) for each in (at_infinity, near))
        along = end - begin
        length2 = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
        share = np.clip(((self.followed - begin) * along).sum(axis=1) / length2, 0.0, 1.0)
        return np.asarray(np.linalg.norm(self.followed - begin - share[:, None] * along, axis=1))


@dataclass(frozen=True, eq=False)
class FollowedCorners:
    """n corners of an earlier view, followed into a later one.

    They are at `points` (n x 3, m) with `covariances` (n x 3 x 3, m^2) in the earlier camera's frame, and in the later
    view at `uv` (n x 2 px), where they are `measured` (n). `pixel` is the width of a pixel in the rays' unit. Beside
    them there are those that are `depthless`.
    """

    points: Array
    covariances: Array
    uv: Array
    measured: Measurements
    pixel: float
    depthless: DepthlessCorners

    @classmethod
    def between(cls, earlier: EarlierView, view: View, twist: Array, sensor: SensorModel) -> "FollowedCorners":
        """Return the corners that can be followed to a `view`, in motion with `twist` (6, SI), and back."""
        uv = 2.0 * detect_corners(earlier.view.images.half, np.zeros((0, 2)), TUNING.other_cell_px // 2)
        uv = uv[earlier.view.stands(uv)]
        seen = measure_exactly(earlier.view, sensor, uv, earlier.twist)
        is_deep = seen.values[:, 2] > 0.0
        points, covariances = points_of(seen.take(is_deep))
        rows, uv_deep, measured = _followed(earlier, view, twist, sensor, uv[is_deep], points)
        rays = seen.values[~is_deep, :2]
        far = np.column_stack([rays, np.ones(len(rays))]) * _FAR_M
        rows_far, _, measured_far = _followed(earlier, view, twist, sensor, uv[~is_deep], far)
        depthless = DepthlessCorners(rays[rows_far], measured_far.values[:, :2])
        pixel = 1.0 / sensor.lens.intrinsics[0]
        return cls(points[rows], covariances[rows], uv_deep, measured, float(pixel), depthless)

    def take(self, rows: Mask) -> "FollowedCorners":
        """Return the chosen corners."""
        points, covariances, measured = self.points[rows], self.covariances[rows], self.measured.take(rows)
        return FollowedCorners(points, covariances, self.uv[rows], measured, self.pixel, self.depthless)

    @cached_property
    def features(self) -> FollowedFeatures:
        """The corners as features, all of them proven alike."""
        rays, alike = self.measured.values[:, :2], np.full(len(self.uv), math.ceil(TUNING.proven_frames))
        sigma_px = TUNING.followed_sigma_px
        return FollowedFeatures(self.points, np.zeros(3), rays, self.uv, alike, sigma_px, self.pixel)

    def fit(self, T_start: Array, used: Mask) -> PoseFit:
        """Return the pose of the view in the earlier camera's frame by those `used`, from the start `T_start`."""
        values, variances = self.measured.values, self.measured.covariance
        return fit_pose(self.points, self.covariances, values, variances, T_start, used)

    def against(self, T_view_earlier: Array) -> float:
        """Return the share of corners without depth that deny a motion; 0 where these or the others cannot tell.

        Where only a body has depth, as in a hall or with a sensor of little range, these alone see the scene move. But
        if those that agree with the motion are farther apart in depth than a body is deep, they lie on the scene, and
        somebody too near to be measured moves before it.
        """
        agrees = self.features.off_px(T_view_earlier) < TUNING.differs_px
        if len(self.depthless.rays) < TUNING.scene_least or not agrees.any():
            return 0.0
        near, far = np.quantile(self.points[agrees, 2], (0.1, 0.9))
        if far > TUNING.body_deep * near:
            return 0.0
        return float((self.depthless.off_line(T_view_earlier) > TUNING.differs_clearly_px * self.pixel).mean())


def _followed(
    earlier: EarlierView, view: View, twist: Array, sensor: SensorModel, uv: Array, points: Array
) -> tuple[Index, Array, Measurements]:
    """Return which corners (n) at `uv` (n x 2 px) are followed, where to, and as what they are measured there.

    They are looked for where a camera that moved as expected sees `points` (n x 3, m, the earlier camera's frame).
    """
    expected = sensor.lens.project(points, se3.inverse(earlier.T_view_corners))
    rows = np.flatnonzero(expected[:, 2] > 0.0)
    images, scale = (earlier.view.images.half, view.images.half), view.images.scale
    begin, guess = uv[rows] / 2.0, expected[rows, :2] / 2.0
    here, found = follow_there_and_back(*images, begin, guess, TUNING.other_back_px, scale)
    rows, uv_here = rows[found], 2.0 * here[found]
    exact = np.tile([TUNING.found_sigma_px**2, 0.0, TUNING.found_sigma_px**2], (len(rows), 1))
    return rows, uv_here, measure(view, sensor, uv_here, exact, twist)
