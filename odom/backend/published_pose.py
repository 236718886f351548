"""A pose as published, never changed later, with the motions since earlier ones."""

from dataclasses import dataclass, field, replace

import numpy as np

from odom.backend.doubt import Doubt
from odom.backend.estimate import Estimate, RelativePose
from odom.backend.map.frame_log import LoggedFrame
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class PublishedPose:
    """The `frame` at the stamp itself, its published pose `T_odom_camera`, and the motions since earlier frames.

    `covariance` (6 x 6, `se3`, camera frame) is that of the pose since its segment began. `T_middle_stamp` is the
    motion from the time of the image's middle row to the stamp, with its 6 x 6 covariance. `step` is the motion since
    the frame before, `second` the one over a second. By `doubt` the covariances allow for a camera that follows a
    moving body. The pose of a frame that could not be tracked `is_predicted`.
    """

    frame: LoggedFrame
    T_odom_camera: Array
    covariance: Array | None
    T_middle_stamp: Array = field(default_factory=lambda: np.eye(4))
    covariance_middle_stamp: Array = field(default_factory=lambda: np.zeros((6, 6)))
    step: RelativePose | None = None
    second: RelativePose | None = None
    doubt: Doubt = field(default_factory=Doubt)
    is_predicted: bool = False

    def in_estimate(self, estimate: Estimate) -> Estimate:
        """Return a frame's estimate with its pose, a copy that may be changed, and its motions."""
        return replace(
            estimate,
            T_odom_camera=self.T_odom_camera.copy(),
            covariance=self.covariance,
            step=self.step,
            second=self.second,
            is_predicted=self.is_predicted,
        )
