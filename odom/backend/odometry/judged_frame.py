"""A tracked frame whose pose has been judged, before and after it is published."""

from dataclasses import dataclass

from odom.backend.estimate import State
from odom.backend.published_pose import PublishedPose
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.features.view import View
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class JudgedFrame:
    """A tracked view's pose `covariance` (6 x 6), `twist` (6, SI, camera frame), `state` and `reason`.

    `since_previous_s` is the time since the frame before, None where the motion since then is not known.
    """

    view: View
    tracked: TrackedFrame
    since_previous_s: float | None
    twist: Array
    covariance: Array
    state: State
    reason: str


@dataclass(frozen=True, eq=False)
class PlacedFrame:
    """A frame that landmarks placed, as it was `judged` and `published`."""

    judged: JudgedFrame
    published: PublishedPose
