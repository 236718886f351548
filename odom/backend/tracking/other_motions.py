"""What else moves as one in a view, and how unsure that leaves the camera's velocity.

Where much of a view moves, the camera may follow a body. Then the true motion is that of other features, and it is
measured as well as the one that is followed. Each motion is a hypothesis, worth its features' share of the votes; the
second moment of such a mixture is the covariance of the camera's velocity, and no speeds of bodies need be assumed.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from odom.backend.tracking.consensus import FollowedFeatures, consensus
from odom.backend.tracking.expected_pose import ExpectedPose
from odom.backend.tracking.pose_solver import PoseFit, fit_pose
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.measurement import Measurements, measure, measure_exactly, points_of
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import EarlierView
from odom.frontend.matching.optical_flow import follow_there_and_back
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask

_MOST_MOTIONS = 3
"""Motions beside the camera's that are looked for: what has fewer votes than these hardly changes the covariance."""


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

    @classmethod
    def between(cls, earlier: EarlierView, view: View, twist: Array, sensor: SensorModel) -> "FollowedCorners":
        """Return the corners with depth that can be followed to a `view`, in motion with `twist` (6, SI), and back."""
        images = earlier.view.images.half, view.images.half
        uv = 2.0 * detect_corners(images[0], np.zeros((0, 2)), TUNING.other_cell_px // 2)
        uv = uv[earlier.view.stands(uv)]
        seen = measure_exactly(earlier.view, sensor, uv, earlier.twist)
        deep = seen.values[:, 2] > 0.0
        uv, (points, covariances) = uv[deep], points_of(seen.take(deep))
        expected = sensor.lens.project(points, se3.inverse(earlier.T_view_corners))
        rows = np.flatnonzero(expected[:, 2] > 0.0)
        begin, guess, scale = uv[rows] / 2.0, expected[rows, :2] / 2.0, view.images.scale
        here, found = follow_there_and_back(*images, begin, guess, TUNING.other_back_px, scale)
        rows, uv = rows[found], 2.0 * here[found]
        exact = np.tile([TUNING.found_sigma_px**2, 0.0, TUNING.found_sigma_px**2], (len(rows), 1))
        measured, pixel = measure(view, sensor, uv, exact, twist), 1.0 / sensor.lens.intrinsics[0]
        return cls(points[rows], covariances[rows], uv, measured, pixel)

    def take(self, rows: Mask) -> "FollowedCorners":
        """Return the chosen corners."""
        measured = self.measured.take(rows)
        return FollowedCorners(self.points[rows], self.covariances[rows], self.uv[rows], measured, self.pixel)

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


@dataclass(frozen=True, eq=False)
class OtherMotion:
    """A motion with a `share` of the votes; the camera's differs from it by `off` (6, `se3`, later camera's frame).

    Corners that agree with both motions, as far ones may, have no vote. If those of this motion alone stood still,
    `off` would be the camera's error, with 6 x 6 `covariance`. `is_behind`: they lie behind those of the camera's.
    """

    share: float
    off: Array
    covariance: Array
    is_behind: bool

    @property
    def is_scene(self) -> bool:
        """Whether it is rather the scene's motion than the camera's own is: most of the votes, and behind."""
        return self.is_behind and self.share > TUNING.scene_share


def _is_behind(followed: FollowedCorners, chosen: Mask, others: Mask) -> bool:
    """Return whether the `chosen` corners (n) lie behind the `others` (n): people walk before a scene, not behind it.

    Where a body hides much, a few of the others may lie far away.
    """
    depth = followed.points[:, 2]
    if len(depth) < TUNING.scene_least or not chosen.any() or not others.any():
        return False
    return bool(np.median(depth[chosen]) > TUNING.scene_behind * np.quantile(depth[others], TUNING.scene_rest))


def shows_scene(followed: FollowedCorners, agrees: Mask, view: View) -> bool:
    """Return whether corners that agree with a motion (n) show the scene: most, and behind the rest or nearly alone."""
    votes = followed.features.votes
    is_most = votes[agrees].sum() >= TUNING.scene_share * votes.sum()
    return (is_most and _is_behind(followed, agrees, ~agrees)) or _reaches_far(followed, agrees, view)


def _reaches_far(followed: FollowedCorners, agrees: Mask, view: View) -> bool:
    """Return whether corners that agree with a motion (n) are most by far, and lie all over the image.

    Where nothing else moves, nothing lies before the scene. A body does not reach so far, unless it hides nearly all.
    """
    import cv2

    votes = followed.features.votes
    if votes[agrees].sum() < TUNING.scene_alone * votes.sum():
        return False
    hull = cv2.convexHull(followed.uv[agrees].astype(np.float32))
    return bool(cv2.contourArea(hull) > TUNING.scene_reach * view.depth_mm.size)


def other_motions(followed: FollowedCorners, T_view_earlier: Array, since_s: float) -> Iterator[OtherMotion]:
    """Yield the motions of corners that do not follow the camera's own, which is T_view_earlier over `since_s`."""
    features = followed.features
    is_own = features.off_px(T_view_earlier) <= TUNING.differs_px
    is_left, votes = ~is_own, features.votes
    expected = ExpectedPose.at_unknown_velocity(T_view_earlier, since_s)
    for _ in range(_MOST_MOTIONS):
        left = followed.take(is_left)
        T = consensus(left.features, T_view_earlier, expected)
        if T is None:
            return
        fit = left.fit(T, left.features.off_px(T) < TUNING.differs_px)
        agrees = features.off_px(fit.T_camera_map) < TUNING.differs_px
        theirs, ours = agrees & ~is_own, is_own & ~agrees
        if not theirs.any():
            return
        is_clear = bool(np.median(features.off_px(T_view_earlier)[theirs]) > TUNING.differs_clearly_px)
        share = float(votes[theirs].sum() / (votes[theirs | ours] if is_clear else votes).sum())
        off = se3.log(T_view_earlier @ se3.inverse(fit.T_camera_map))
        is_behind = is_clear and _is_behind(followed, theirs, ours)
        yield OtherMotion(share, off, np.asarray(np.linalg.inv(fit.information)), is_behind)
        is_left &= ~agrees


@dataclass(frozen=True, eq=False)
class WhatElseMoves:
    """The motions in a view beside the camera's: `share` is the largest share of the votes, 0 if there are none.

    `behind` is the largest of those that lie behind what moves with the camera.
    `spread` is the 6 x 6 covariance ((m/s, rad/s)^2, camera frame) of the camera's velocity by all of them.
    `has_scene`: one of them is the scene's. `is_confirmed`: the camera's own motion is.
    """

    share: float
    spread: Array
    has_scene: bool = False
    is_confirmed: bool = False
    behind: float = 0.0


def what_else_moves(earlier: EarlierView, view: View, twist: Array, sensor: SensorModel) -> WhatElseMoves | None:
    """Return what else moves between an `earlier` view and this one, where the camera moves with `twist` (6, SI).

    None where too few corners can be followed to tell.
    """
    followed = FollowedCorners.between(earlier, view, twist, sensor)
    if len(followed.uv) < TUNING.contested_least:
        return None
    since_s, T_view_earlier = view.since_s(earlier.view), se3.inverse(earlier.T_view_corners)
    others = list(other_motions(followed, T_view_earlier, since_s))
    agrees = followed.features.off_px(T_view_earlier) < TUNING.differs_px
    is_confirmed = shows_scene(followed, agrees, view)
    spread = sum((one.share * (np.outer(one.off, one.off) + one.covariance) for one in others), np.zeros((6, 6)))
    share, has_scene = max((one.share for one in others), default=0.0), any(one.is_scene for one in others)
    behind = max((one.share for one in others if one.is_behind), default=0.0)
    return WhatElseMoves(share, np.asarray(spread / since_s**2), has_scene, is_confirmed, behind)
