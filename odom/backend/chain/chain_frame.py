"""A frame as the chain takes it: what it shows, how it was moving, and how its pose is carried to its stamp."""

from dataclasses import dataclass

import numpy as np

from odom.backend.chain.named_features import NamedFeatures
from odom.backend.published_pose import PublishedPose
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.view import View
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class ChainFrame:
    """A frame that the chain is to be extended by: its `view`, the `features` it measured, and how it was `published`.

    It was taken in motion with `twist` (6, SI, camera frame).
    """

    view: View
    features: NamedFeatures
    twist: Array
    published: PublishedPose

    def stamp_covariance(self, sensor: SensorModel) -> Array:
        """Return the 6 x 6 covariance of carrying a pose from the middle row's time to the jittering stamp."""
        jitter = sensor.clock.jitter_s**2 * (self.twist[:, None] * self.twist)
        return np.asarray(jitter + self.published.covariance_middle_stamp)
