"""What else moves as one in a view, and how unsure that leaves the camera's velocity.

Where much of a view moves, the camera may follow a body. Then the true motion is that of other features, and it is
measured as well as the one that is followed. Each motion is a hypothesis, worth its features' share of the votes; the
second moment of such a mixture is the covariance of the camera's velocity, and no speeds of bodies need be assumed.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from odom.backend.tracking.consensus import consensus
from odom.backend.tracking.corner_flow import CornerFlow, FollowedCorners
from odom.backend.tracking.expected_pose import ExpectedPose
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import EarlierView
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask

_MOST_MOTIONS = 3
"""Motions beside the camera's that are looked for: what has fewer votes than these hardly changes the covariance."""


@dataclass(frozen=True, eq=False)
class OtherMotion:
    """A motion with a `share` of the votes; the camera's differs from it by `off` (6, `se3`, later camera's frame).

    Where the two differ clearly, corners that agree with both, as far ones may, have no vote. If those of this motion
    alone stood still, `off` would be the camera's error, with 6 x 6 `covariance`. `is_behind`: they differ clearly, and
    lie behind those of the camera's.
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


def _moves_alone(sample: FollowedCorners, T_view_earlier: Array) -> bool:
    """Return whether a `sample` of the corners is enough to tell, and shows hardly a motion beside the camera's.

    Against the camera's is less than half of what a motion needs to be the scene's.
    """
    votes, off_px = sample.features.votes, sample.features.off_px(T_view_earlier)
    against = votes[off_px > TUNING.differs_px].sum()
    return len(votes) >= TUNING.contested_least and bool(against < 0.5 * TUNING.scene_share * votes.sum())


@dataclass(frozen=True, eq=False)
class WhatElseMoves:
    """The motions in a view beside the camera's: `share` is the largest share of the votes, 0 if there are none.

    `behind` is the largest of those that lie behind what moves with the camera, as what has no depth is taken to do.
    `is_denied`: most of what has no depth denies the camera's motion.
    `spread` is the 6 x 6 covariance ((m/s, rad/s)^2, camera frame) of the camera's velocity by all of them.
    `has_scene`: one of them is the scene's. `is_confirmed`: the camera's own motion is; then it is not denied.
    """

    share: float
    spread: Array
    has_scene: bool = False
    is_confirmed: bool = False
    behind: float = 0.0
    is_denied: bool = False


def what_else_moves(
    earlier: EarlierView, view: View, twist: Array, sensor: SensorModel, is_warned: bool
) -> WhatElseMoves | None:
    """Return what else moves between an `earlier` view and this one, where the camera moves with `twist` (6, SI).

    None where too few corners can be followed to tell, and where a few of them show the camera's motion alone, unless
    the pose `is_warned` of: then all are looked at.
    """
    flow = CornerFlow(earlier, view, twist, sensor)
    since_s, T_view_earlier = view.since_s(earlier.view), se3.inverse(earlier.T_view_corners)
    if not is_warned and _moves_alone(flow.sample, T_view_earlier):
        return None
    followed = flow.deep
    if len(followed.uv) < TUNING.contested_least:
        return None
    others = list(other_motions(followed, T_view_earlier, since_s))
    agrees = followed.features.off_px(T_view_earlier) < TUNING.differs_px
    is_confirmed = shows_scene(followed, agrees, view)
    spread = sum((one.share * (np.outer(one.off, one.off) + one.covariance) for one in others), np.zeros((6, 6)))
    share, has_scene = max((one.share for one in others), default=0.0), any(one.is_scene for one in others)
    behind = max((one.share for one in others if one.is_behind), default=0.0)
    # In a hall, or with a sensor of little range, a body may alone have depth: then the rest sees the scene move. Where
    # corners near and far agree, they are the scene, and somebody too near to be measured moves before it.
    may_follow = not is_confirmed and followed.may_be_a_body(agrees)
    against = flow.depthless.against(T_view_earlier, flow.pixel) if may_follow else 0.0
    is_denied = against > TUNING.scene_share
    behind = max(behind, against) if is_denied else behind
    return WhatElseMoves(share, np.asarray(spread / since_s**2), has_scene, is_confirmed, behind, is_denied)
