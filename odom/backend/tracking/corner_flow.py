"""Corners of one view followed into another: those with depth can tell motions apart, those without can deny one."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from odom.backend.tracking.pose_solver import PoseFit, fit_pose
from odom.backend.tracking.tuning import TUNING
from odom.backend.tracking.voting_features import VotingFeatures
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.measurement import Measurements, measure, measure_exactly, points_of
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import EarlierView
from odom.frontend.matching.optical_flow import follow_there_and_back
from odom.frontend.matching.tuning import TUNING as MATCHING
from odom.geometry import se3
from odom.geometry.arrays import Array, Image, Index, Mask

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

    def against(self, T_view_earlier: Array, pixel: float) -> float:
        """Return the share of them that deny a motion; 0 where they are too few. `pixel` is one's width, rays' unit."""
        if len(self.rays) < TUNING.scene_least:
            return 0.0
        return float((self.off_line(T_view_earlier) > TUNING.differs_clearly_px * pixel).mean())


@dataclass(frozen=True, eq=False)
class FollowedCorners:
    """n corners of an earlier view, followed into a later one.

    They are at `points` (n x 3, m) with `covariances` (n x 3 x 3, m^2) in the earlier camera's frame, and in the later
    view at `uv` (n x 2 px), where they are `measured` (n). `pixel` is the width of a pixel in the rays' unit.
    """

    points: Array
    covariances: Array
    uv: Array
    measured: Measurements
    pixel: float

    def take(self, rows: Mask) -> "FollowedCorners":
        """Return the chosen corners."""
        measured = self.measured.take(rows)
        return FollowedCorners(self.points[rows], self.covariances[rows], self.uv[rows], measured, self.pixel)

    @cached_property
    def features(self) -> VotingFeatures:
        """The corners as features, all of them proven alike."""
        rays, alike = self.measured.values[:, :2], np.full(len(self.uv), math.ceil(TUNING.proven_frames))
        sigma_px = TUNING.followed_sigma_px
        return VotingFeatures(self.points, np.zeros(3), rays, self.uv, alike, sigma_px, self.pixel)

    def fit(self, T_start: Array, used: Mask) -> PoseFit:
        """Return the pose of the view in the earlier camera's frame by those `used`, from the start `T_start`."""
        values, variances = self.measured.values, self.measured.covariance
        return fit_pose(self.points, self.covariances, values, variances, T_start, used)

    def may_be_a_body(self, chosen: Mask) -> bool:
        """Return whether the `chosen` corners (n) are no farther apart in depth than a body is deep."""
        if not chosen.any():
            return False
        near, far = np.quantile(self.points[chosen, 2], (0.1, 0.9))
        return bool(far <= TUNING.body_deep * near)


@dataclass(frozen=True, eq=False)
class CornerFlow:
    """The corners of an `earlier` view and where they are followed to, and back, in a `view` with `twist` (6, SI)."""

    earlier: EarlierView
    view: View
    twist: Array
    sensor: SensorModel

    @cached_property
    def sample(self) -> FollowedCorners:
        """A few of those with depth, all over the image, found where it is a quarter as wide: for a first look."""
        import cv2

        quarter = np.asarray(cv2.pyrDown(self.earlier.view.images.half), dtype=np.uint8)
        return self._deep(*self._found(quarter, 4, TUNING.sample_cell_px))

    @cached_property
    def deep(self) -> FollowedCorners:
        """Those with depth."""
        return self._deep(*self._corners)

    @cached_property
    def depthless(self) -> DepthlessCorners:
        """Those without."""
        uv, seen = self._corners
        is_depthless = ~(seen.values[:, 2] > 0.0)
        rays = seen.values[is_depthless, :2]
        far = np.column_stack([rays, np.ones(len(rays))]) * _FAR_M
        rows, _, measured = self._followed(uv[is_depthless], far)
        return DepthlessCorners(rays[rows], measured.values[:, :2])

    @cached_property
    def _corners(self) -> tuple[Array, Measurements]:
        """All corners of the earlier view (k x 2 px), as measured there."""
        return self._found(self.earlier.view.images.half, 2, TUNING.other_cell_px)

    def _found(self, image: Image, smaller: int, cell_px: int) -> tuple[Array, Measurements]:
        """Return the corners (k x 2 px) found in the earlier view's image, so many times `smaller`, as measured."""
        earlier = self.earlier
        uv = float(smaller) * detect_corners(image, np.zeros((0, 2)), cell_px // smaller)
        uv = uv[earlier.view.stands(uv)]
        return uv, measure_exactly(earlier.view, self.sensor, uv, earlier.twist)

    def _deep(self, uv: Array, seen: Measurements) -> FollowedCorners:
        """Return those with depth of the corners at `uv` (k x 2 px), as `seen` in the earlier view, followed."""
        is_deep = seen.values[:, 2] > 0.0
        points, covariances = points_of(seen.take(is_deep))
        rows, uv_here, measured = self._followed(uv[is_deep], points)
        return FollowedCorners(points[rows], covariances[rows], uv_here, measured, self.pixel)

    @property
    def pixel(self) -> float:
        """The width of a pixel in the rays' unit."""
        return float(1.0 / self.sensor.lens.intrinsics[0])

    def _followed(self, uv: Array, points: Array) -> tuple[Index, Array, Measurements]:
        """Return which corners (n) at `uv` (n x 2 px) are followed, where to, and as what they are measured there.

        They are looked for where a camera that moved as expected sees `points` (n x 3, m, the earlier camera's frame),
        and, where that is far away, where they were: a wide step may be a body's.
        """
        earlier, view = self.earlier, self.view
        expected = self.sensor.lens.project(points, se3.inverse(earlier.T_view_corners))
        rows = np.flatnonzero(expected[:, 2] > 0.0)
        images, scale = (earlier.view.images.half, view.images.half), view.images.scale
        begin, guess, return_px = uv[rows] / 2.0, expected[rows, :2] / 2.0, MATCHING.look_back_return_px
        here, found = follow_there_and_back(*images, begin, guess, return_px, scale)
        far = np.flatnonzero(~found & (np.linalg.norm(guess - begin, axis=1) > TUNING.other_far_px))
        if len(far):
            here[far], found[far] = follow_there_and_back(*images, begin[far], begin[far], return_px, scale)
        rows, uv_here = rows[found], 2.0 * here[found]
        exact = np.tile([TUNING.found_sigma_px**2, 0.0, TUNING.found_sigma_px**2], (len(rows), 1))
        return rows, uv_here, measure(view, self.sensor, uv_here, exact, self.twist)
