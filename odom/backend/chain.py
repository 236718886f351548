"""The paper's chain: every frame registered against the one before it, C_i+1 against C_i, by the robust filter."""

import numpy as np

from odom.backend.estimate import RelativePose
from odom.backend.publication import Publication
from odom.backend.tracking.frame_state import Tracked
from odom.backend.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.measurement import points_of
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.registration import Pairs, Prior, register


class Chain:
    """The chain's end: the newest frame and its `link`, the registration of that frame against the one before."""

    def __init__(self) -> None:
        self.link: RelativePose | None = None
        self._tracked: Tracked | None = None
        self._published: Publication | None = None

    def begin(self, published: Publication) -> None:
        """Begin anew with a frame that has not been tracked: the next frame has no link."""
        self.link, self._tracked, self._published = None, None, published

    def extend(
        self, T_previous_map: Array | None, tracked: Tracked, published: Publication, sensor: SensorModel
    ) -> RelativePose | None:
        """Return the link of one more frame to the one before, None where there is none.

        `T_previous_map` is where the map has the frame before now, None where the new one did not follow from it.
        """
        before, published_before = self._tracked, self._published
        self.link, self._tracked, self._published = None, tracked, published
        if T_previous_map is not None and before is not None and published_before is not None:
            self.link = _register(before, T_previous_map, published_before, tracked, published, sensor)
        return self.link


def _register(
    previous: Tracked,
    T_previous_map: Array,
    published_previous: Publication,
    current: Tracked,
    published: Publication,
    sensor: SensorModel,
) -> RelativePose | None:
    """Return T_previous_current from the features that both frames measured with depth, None where that fails.

    The recursive robust filter weighs both clouds' covariances; the motion in the map is only a hint to its gate. The
    covariance grows by the noise monitor's scale and by how far the camera moves while two stamps jitter; from the
    middle rows' times the motion is carried to the stamps as the two publications are.
    """
    _, a, b = np.intersect1d(previous.rows, current.rows, assume_unique=True, return_indices=True)
    deep = (previous.measurements.values[a, 2] > 0.0) & (current.measurements.values[b, 2] > 0.0)
    a, b = a[deep], b[deep]
    if len(a) < TUNING.chain_least_pairs:
        return None
    points_previous, covariances_previous = points_of(previous.measurements.take(a))
    points_current, covariances_current = points_of(current.measurements.take(b))
    pairs = Pairs(points_current, points_previous, covariances_current, covariances_previous)
    hint = Prior(T_previous_map @ current.T_map_camera)
    registration = register(pairs, hint)
    if not registration.ok:
        return None
    jitter = 2.0 * sensor.clock.jitter_s**2 * np.outer(current.twist, current.twist)
    covariance = sensor.noise.covariance_scale * registration.covariance + jitter
    covariance += published_previous.covariance_middle_stamp + published.covariance_middle_stamp
    T_middles = registration.T_target_source
    T_previous_current = se3.inverse(published_previous.T_middle_stamp) @ T_middles @ published.T_middle_stamp
    inliers = int(registration.inliers.sum())
    return RelativePose(published_previous.frame.stamp, T_previous_current, covariance, inliers)
