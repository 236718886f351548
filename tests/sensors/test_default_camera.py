import pytest

from odom.frame import Camera
from sensors.default_camera import kinect_camera
from sensors.openni2.messages import DeviceEncoder
from sensors.openni2.settings import KinectSettings
from sensors.source import SourceOptions


def test_a_driver_without_field_of_view_gets_a_kinects_camera_and_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    encoder = DeviceEncoder(SourceOptions(), KinectSettings(size="320x240"), None, registered=True)
    assert encoder.camera == kinect_camera(320, 240) == Camera(320, 240, 262.5, 262.5, 159.5, 119.5)
    assert "--camera" in caplog.text
