"""What is known of a camera before its first frame."""

import numpy as np

from odom.backend.settings import OdometrySettings
from odom.errors import ConfigError, check_type
from odom.frame import Camera
from odom.frontend.camera.noise_monitor import FeatureNoise, NoiseMonitor
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import StampClock
from odom.frontend.features.image_scale import scaled_lens

_LEAST_SIDE_PX = 64
"""Narrower images hold no patches in which landmarks could be searched."""
_INVERSE_DEPTH_KNOTS = np.array([0.15, 0.3, 0.5, 0.8, 1.2, 2.0])
"""Inverse depths (1/m) at which the noise of depth is learnt: from 6.7 m to .5 m, the range of a Kinect."""


def unproven_sensor(camera: Camera, settings: OdometrySettings) -> SensorModel:
    """Return the sensor model of a camera by the settings alone, for its images as they are scaled.

    Raises ConfigError for images too small to track in, an unknown lens model, or arguments of other types.
    """
    check_type("camera", camera, Camera, "odom.Camera(width, height, fx, fy, cx, cy)", ConfigError)
    check_type("settings", settings, OdometrySettings, "odom.OdometrySettings(name=value)", ConfigError)
    if min(camera.width, camera.height) < _LEAST_SIDE_PX:
        raise ConfigError(f"{camera}: images need {_LEAST_SIDE_PX} pixels each way at least")
    knots = _INVERSE_DEPTH_KNOTS
    noise = FeatureNoise(settings.pixel_sigma_px, np.stack([knots, np.full_like(knots, settings.inverse_depth_sigma)]))
    sigma_s = [settings.readout_prior_sigma_s, settings.depth_lag_prior_sigma_s, settings.depth_readout_prior_sigma_s]
    timing = ShutterTiming(settings.readout_prior_s, settings.depth_lag_prior_s, settings.depth_readout_prior_s)
    information = np.diag(np.array(sigma_s) ** -2.0)
    return SensorModel(scaled_lens(camera), timing, information, StampClock(), NoiseMonitor.of(noise))
