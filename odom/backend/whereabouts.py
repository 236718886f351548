"""Where the camera was last, and how that goes with the map as the map moves."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.backend.causal import Publication
from odom.backend.estimate import RelativePose
from odom.backend.map import Map
from odom.backend.motion import Motion
from odom.backend.selfcheck import SelfCheck
from odom.backend.tracking import Before, Tracked
from odom.frame import Stamp
from odom.frontend.view import View
from odom.registration import se3

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Previous:
    """The last frame that was tracked, or that began a segment (`tracked` is None).

    The next one is followed from it by the landmarks `rows` (n), which it showed at `uv` (n x 2 px).
    """

    view: View
    tracked: Tracked | None
    pairwise: RelativePose | None
    published: Publication
    rows: Index
    uv: Array


@dataclass(frozen=True, eq=False)
class Whereabouts:
    """Where the camera was as of the `previous` frame: `T_camera_map`, near key frame `near`, moving with `twist`.

    The twist is 6, SI, in the camera's own frame; `is_bridged` where predictions have stood in for frames since.
    """

    previous: Previous
    T_camera_map: Array
    twist: Array
    near: int
    is_bridged: bool = False

    def since_s(self, stamp: Stamp) -> float:
        """Return the time from the previous frame to the steady `stamp`."""
        return (stamp - self.previous.view.frame.stamp) * 1e-9

    def before(self, dt: float, check: SelfCheck) -> Before:
        """Return the camera's motion in the map, `dt` seconds ago."""
        tracked = self.previous.tracked
        motion = Motion.of(se3.inverse(self.T_camera_map), np.zeros((6, 6)))
        if tracked is not None:
            motion = Motion.of(motion.T_fixed_camera, tracked.covariance * check.scale, tracked.velocity)
        return Before(motion, dt, check.scale)

    def T_near_camera(self, map_: Map) -> Array:
        """Return the pose in the key frame near it."""
        return map_.keyframes[self.near].T_camera_map @ se3.inverse(self.T_camera_map)

    def with_map(self, map_: Map, T_near_camera: Array) -> "Whereabouts":
        """Return where it was now that the map has moved, and what it was in the key frame near it before."""
        return replace(self, T_camera_map=se3.inverse(T_near_camera) @ map_.keyframes[self.near].T_camera_map)
