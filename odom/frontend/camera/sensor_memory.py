"""What is remembered of a camera from one session to the next: timing of its shutters, tilt of its depth, noise."""

from dataclasses import dataclass, replace

import numpy as np

from odom.frontend.camera.depth_tilt import DepthTilt
from odom.frontend.camera.noise_monitor import FeatureNoise
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.tuning import TUNING
from odom.geometry.arrays import Array

_SEEN = 1_000_000
"""Remembered noise counts as so many frames, so that the first new ones do not replace it."""


@dataclass(frozen=True, eq=False)
class SensorMemory:
    """The `timing` with its information (3 x 3, 1/s^2), the `depth_tilt`, `noise`, and inflations of covariances."""

    timing: ShutterTiming
    timing_information: Array
    noise: FeatureNoise
    inflation_by_halves: float
    inflation_by_jumps: float
    depth_tilt: DepthTilt

    @classmethod
    def of(cls, sensor: SensorModel) -> "SensorMemory":
        """Return what is to be remembered of a camera."""
        monitor = sensor.noise
        inflations = monitor.inflation_by_halves, monitor.inflation_by_jumps
        return cls(sensor.timing, sensor.timing_information, monitor.feature_noise, *inflations, sensor.depth_tilt)

    def recalled(self, sensor: SensorModel) -> SensorModel:
        """Return the model of a camera that has shown nothing yet, with what is remembered of it.

        The timing is a little less sure than it was, since a device that was switched off and on may differ.
        """
        variance = np.linalg.inv(self.timing_information) + TUNING.timing_restart_s**2 * np.eye(3)
        information = np.asarray(np.linalg.inv(variance), dtype=np.float64)
        noise = replace(
            sensor.noise,
            feature_noise=self.noise,
            inflation_by_halves=self.inflation_by_halves,
            inflation_by_jumps=self.inflation_by_jumps,
            halves_seen=_SEEN,
            residuals_seen=_SEEN,
            jumps_seen=_SEEN,
        )
        return replace(
            sensor, timing=self.timing, timing_information=information, noise=noise, depth_tilt=self.depth_tilt
        )
