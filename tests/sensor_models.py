"""Sensor models for tests: a camera with the noise and timing that a test wants."""

import numpy as np

from odom.frame import Camera
from odom.frontend.camera.noise_monitor import FeatureNoise, NoiseMonitor
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import StampClock
from odom.frontend.features.image_scale import scaled_lens
from odom.frontend.features.images import FrameImages
from odom.frontend.features.view import View

NOISE = FeatureNoise(0.5, np.array([[0.2, 2.0], [2e-3, 2e-3]]))


def sensor_model(camera: Camera, timing: ShutterTiming | None = None, noise: FeatureNoise = NOISE) -> SensorModel:
    """A sensor whose timing and noise are known, for images as they are scaled."""
    timing = timing or ShutterTiming()
    return SensorModel(scaled_lens(camera), timing, np.eye(3), StampClock(), NoiseMonitor.of(noise))


def view_of(frame, images: FrameImages | None = None) -> View:
    """A frame as it is seen by a clock without jitter."""
    return View.of(frame, frame.sequence, StampClock().after(frame.stamp), images or FrameImages.of(frame.color))
